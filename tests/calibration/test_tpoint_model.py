"""TPOINT model files: every term against the published formula, round trips, and what a file cannot say."""

from collections.abc import Callable

import numpy as np
import pytest

from gimbalcal.calibration.exchange import export, read_calibration
from gimbalcal.calibration.exchange.tpoint_model import NAMES, tpoint_terms
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.forward import predict
from gimbalcal.number import Array
from gimbalcal.views.pointing import on_stars
from tests.estimate.pointing.mounts import ALT_AZ, ARCSEC, EQUATORIAL, LATITUDE, effects, run, sky
from tests.golden import refused

Formula = Callable[[Array, Array], tuple[Array | float, Array | float]]
L = float(LATITUDE)
# true minus raw, Wallace's formulas: hour angle and declination; A from SOUTH through east, elevation
HOUR: dict[str, Formula] = {
    "IH": lambda h, d: (1, 0),
    "ID": lambda h, d: (0, 1),
    "CH": lambda h, d: (1 / np.cos(d), 0),
    "NP": lambda h, d: (np.tan(d), 0),
    "MA": lambda h, d: (-np.cos(h) * np.tan(d), np.sin(h)),
    "ME": lambda h, d: (np.sin(h) * np.tan(d), np.cos(h)),
    "TF": lambda h, d: (np.cos(L) * np.sin(h) / np.cos(d), np.cos(L) * np.cos(h) * np.sin(d) - np.sin(L) * np.cos(d)),
    "TX": lambda h, d: tuple(x / up(h, d) for x in HOUR["TF"](h, d)),
    "HCES": lambda h, d: (np.sin(h), 0),
    "HCEC": lambda h, d: (np.cos(h), 0),
    "DCES": lambda h, d: (0, np.sin(d)),
    "DCEC": lambda h, d: (0, np.cos(d)),
    "HHSH2": lambda h, d: (np.sin(2 * h), 0),
    "HHCH2": lambda h, d: (np.cos(2 * h), 0),
    "HDSD2": lambda h, d: (0, np.sin(2 * d)),
    "HDCD2": lambda h, d: (0, np.cos(2 * d)),
    "PHH": lambda h, d: (h, 0),
    "PDD": lambda h, d: (0, d),
}  # fmt: skip
FROM_SOUTH: dict[str, Formula] = {
    "IA": lambda A, E: (1, 0),
    "IE": lambda A, E: (0, 1),
    "CA": lambda A, E: (1 / np.cos(E), 0),
    "NPAE": lambda A, E: (np.tan(E), 0),
    "AN": lambda A, E: (np.sin(A) * np.tan(E), np.cos(A)),
    "AW": lambda A, E: (-np.cos(A) * np.tan(E), np.sin(A)),
    "TF": lambda A, E: (0, -np.cos(E)),
    "TX": lambda A, E: (0, -1 / np.tan(E)),
    "ACES": lambda A, E: (np.sin(A), 0),
    "ACEC": lambda A, E: (np.cos(A), 0),
    "ECES": lambda A, E: (0, np.sin(E)),
    "ECEC": lambda A, E: (0, np.cos(E)),
    "HASA2": lambda A, E: (np.sin(2 * A), 0),
    "HACA2": lambda A, E: (np.cos(2 * A), 0),
    "HESE2": lambda A, E: (0, np.sin(2 * E)),
    "HECE2": lambda A, E: (0, np.cos(2 * E)),
    "PEE": lambda A, E: (0, E),
}  # fmt: skip
SIZE = 10.0  # arcsec: second order is 5e-4 of it over the poles that are left out


def up(h, d):
    """Sine of the elevation."""
    return np.asarray(np.sin(L) * np.sin(d) + np.cos(L) * np.cos(d) * np.cos(h))


def model(path, *lines, caption="a mount, latitude 39.0 deg"):
    """A TPOINT model file."""
    path.write_text("\n".join([caption, "T   80     1.0000   0.000  0.0000", *lines, "END"]) + "\n")
    return path


def test_every_name_has_its_formula():
    assert {*HOUR, *FROM_SOUTH} == NAMES


@pytest.mark.parametrize("term", HOUR)
def test_hour_angle_and_declination(term, tmp_path):
    only = ["IH  0.0"] if term in ("TF", "TX") else []  # these two any mount can have
    made = read_calibration(model(tmp_path / "a.mod", f"{term}  {SIZE}  0.1", *only))
    readout = sky(EQUATORIAL)
    readout = readout[(up(readout[:, 1], readout[:, 0]) > 0.3) & (np.abs(np.cos(readout[:, 0])) > 0.4)]
    s = on_stars(run(EQUATORIAL, readout, ())).at(true_angle=np.column_stack([readout, 0 * readout[:, 0]]))
    seen = predict(EQUATORIAL, s, made.effects, "pointing")["pointing"] / ARCSEC
    d, h = readout.T
    dh, dd = HOUR[term](h, d)
    np.testing.assert_allclose(seen[:, 0], SIZE * dh * np.cos(d), atol=3e-3)
    np.testing.assert_allclose(seen[:, 1], SIZE * dd + 0 * d, atol=3e-3)


@pytest.mark.parametrize("term", FROM_SOUTH)
def test_azimuth_and_elevation(term, tmp_path):
    only = ["IA  0.0"] if term in ("TF", "TX") else []
    made = read_calibration(model(tmp_path / "a.mod", f"{term}  {SIZE}  0.1", *only))
    readout = sky(ALT_AZ)
    s = on_stars(run(ALT_AZ, readout, ())).at(true_angle=readout)
    seen = predict(ALT_AZ, s, made.effects, "pointing")["pointing"] / ARCSEC
    E, azimuth = readout.T
    dA, dE = FROM_SOUTH[term](np.pi - azimuth, E)
    np.testing.assert_allclose(seen[:, 0], -SIZE * dA * np.cos(E), atol=3e-3)  # across is eastwards of north
    np.testing.assert_allclose(seen[:, 1], SIZE * dE + 0 * E, atol=3e-3)


ALT_AZ_TERMS = {"gimbal_zero__elevation": 30.0, "gimbal_zero__azimuth": -40.0, "axis_collimation": 60.0,
                "nonorthogonality__elevation": -20.0, "base_tilt__north": 25.0, "base_tilt__east": -10.0,
                "tube_flexure": 15.0}  # fmt: skip


def test_a_calibration_comes_back_from_its_model_file(tmp_path):
    made = pointing_calibration([run(ALT_AZ, sky(ALT_AZ), effects(ALT_AZ, **ALT_AZ_TERMS), 1.0)])
    lost = export(made, "tpoint", tmp_path / "tpoint.mod")
    assert lost == ("tpoint has no place for correlations: calibration.json has them",)
    back = read_calibration(tmp_path / "tpoint.mod")
    here = {p.label: (v, s) for p, v, s in zip(made.parameters, made.values, made.sigmas, strict=True)}
    for p, v, s in zip(back.parameters, back.values, back.sigmas, strict=True):
        assert (v, s) == pytest.approx(here[p.label], abs=1e-5 * ARCSEC)
    assert len(back.parameters) == len(made.parameters)
    export(back, "tpoint", tmp_path / "again.mod")
    terms = [(t.name, t.value) for t in tpoint_terms(back)]
    assert terms == [(t.name, pytest.approx(t.value, abs=1e-5 * ARCSEC)) for t in tpoint_terms(made)]


def test_a_tilt_about_any_axis_is_polar_misalignment_and_a_zero_of_the_hour_angle(tmp_path):
    """MA, ME and IH of a mount that leans north by the level point as the lean itself, to second order."""
    lean = effects(EQUATORIAL, base_tilt__north=50.0, base_tilt__east=-30.0, base_tilt__down=20.0)
    made = pointing_calibration([run(EQUATORIAL, sky(EQUATORIAL), lean)], ("gimbal_zero", "base_tilt"))
    export(made, "tpoint", tmp_path / "tpoint.mod")
    back = read_calibration(tmp_path / "tpoint.mod")
    terms = {t.name: t.value / ARCSEC for t in tpoint_terms(back)}
    assert terms["MA"] == pytest.approx(50 * np.sin(L) + 20 * np.cos(L), abs=0.01)
    assert terms["ME"] == pytest.approx(30.0, abs=0.01)
    assert terms["IH"] == pytest.approx(20 * np.sin(L) - 50 * np.cos(L), abs=0.02)
    s = on_stars(run(EQUATORIAL, sky(EQUATORIAL), ()))
    seen = [predict(EQUATORIAL, s, e, "pointing")["pointing"] / ARCSEC for e in (lean, back.effects)]
    np.testing.assert_allclose(*seen, atol=0.03)


def test_what_a_file_cannot_say(tmp_path):
    path = tmp_path / "a.mod"
    with refused():
        read_calibration(model(path, "MA  5.0", caption="some mount"))
    with refused():
        read_calibration(model(path, "IH  5.0", "HXSH3  2.0"))
    with refused():
        read_calibration(model(path, "IH  five"))
    with refused():
        read_calibration(model(path))
    flagged = read_calibration(model(path, "=IH  5.0  0.1", "& ID  6.0"))
    np.testing.assert_allclose(sorted(flagged.values / ARCSEC), [5.0, 6.0])
    unnamed = pointing_calibration([run(ALT_AZ, sky(ALT_AZ), (), 1.0)], ("gimbal_zero_drift",))
    with refused():
        export(unnamed, "tpoint", path)
    more = pointing_calibration([run(ALT_AZ, sky(ALT_AZ), (), 1.0)], more=("gimbal_zero_drift",))
    assert "tpoint has no term for gimbal_zero_drift:azimuth: it is omitted" in export(more, "tpoint", path)
