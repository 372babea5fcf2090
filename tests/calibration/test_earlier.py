"""Files of format 1, where gyroscopes were told in the other direction, are read as what they meant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import from_dict
from gimbalcal.calibration.exchange import read_calibration
from gimbalcal.calibration.exchange.matrices import matrices
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site

S = np.array([0.02, -0.03, 0.01])  # as format 1 had them: what is added to the reading, per rate
E = {"xy": 0.01, "xz": -0.005, "yz": 0.004, "yx": 0.006, "zx": -0.008, "zy": 0.003}
OFF = np.array([[0, E["xy"], E["xz"]], [E["yx"], 0, E["yz"]], [E["zx"], E["zy"], 0]])


def rows() -> list[dict[str, Any]]:
    each = [("bias", "x", 12.0, 0.5, "ug", "bias")]
    each += [("gyro_scale_factor", a, 1e6 * v, 50.0, "ppm", "gyro_scale_factor") for a, v in zip("xyz", S, strict=True)]
    each += [("gyro_misalignment", a, v * 648000 / np.pi, 10.0, "arcsec", "gyro_misalignment") for a, v in E.items()]
    names = ("name", "axis", "value", "sigma", "unit", "effect")
    return [dict(zip(names, row, strict=True)) | {"prior_sigma": 1.0} for row in each]


def content() -> dict[str, Any]:
    sigma = np.array([0.5e-6 * 9.80665, *[50e-6] * 3, *[10 * np.pi / 648000] * 6])
    P = np.diag(sigma**2)
    P[1, 4] = P[4, 1] = 0.5 * sigma[1] * sigma[4]  # scale factor x with the element xy
    label = "gyro_misalignment"
    return {
        "format": 1, "method": "revolutions", "outcome": "", "parameters": rows(), "covariance": P.tolist(),
        "unobservable": [{"direction": {f"{label}:xy": 1.0, f"{label}:yx": -1.0}, "why": "turned as a whole"}],
        "residual": {"chi2": 1.0, "dof": 1, "rms": {}}, "provenance": {},
        "stages": [{"name": "turns", "values": {f"{label}:xz": 1e-3, "x1": 2.0}, "rms": 0.0, "in_words": "",
                    "sigmas": {f"{label}:xz": 1e-4, "x1": 1.0}}],
    }  # fmt: skip


def test_a_unit_of_format_1_reads_what_it_read() -> None:
    made = from_dict(content())
    w = np.random.default_rng(1).uniform(-1, 1, (5, 3))
    channels = {(q, a): w[:, i] for q in ("specific_force", "angular_rate") for i, a in enumerate("xyz")}
    s = stimulus_from_readings(Recording("rotation", "", BENCH, Site(), {}, np.arange(5.0), None, channels))
    np.testing.assert_allclose(gyroscopes(w, s, made.effects), w * (1 + S) + w @ OFF.T, rtol=1e-14)


def test_values_covariances_and_names_go_with_it() -> None:
    made = from_dict(content())
    value = {p.label: v for p, v in zip(made.parameters, made.values, strict=True)}
    assert value["bias:x"] == pytest.approx(12e-6 * 9.80665)
    assert value["gyro_scale_factor:x"] == pytest.approx(1 / 1.02 - 1)  # read 2 % too much
    assert value["gyro_misalignment:xz"] == pytest.approx(0.01 / 1.02)  # x, y of the matrix is beta_xz of Eq. (5)
    assert value["gyro_misalignment:xy"] == pytest.approx(0.005 / 1.02)  # x, z of it -beta_xy
    assert value["gyro_misalignment:yz"] == pytest.approx(-0.006 / 0.97)
    at = [p.label for p in made.parameters]
    i, j = at.index("gyro_scale_factor:x"), at.index("gyro_misalignment:xz")
    assert made.sigmas[i] == pytest.approx(50e-6 / 1.02**2)
    sigma_E = 10 * np.pi / 648000
    # beta = E / (1 + s): both sigmas enter, with their correlation
    expected = np.hypot(sigma_E / 1.02, 0.01 * 50e-6 / 1.02**2) ** 2 - 0.01 / 1.02**3 * 50e-6 * sigma_E
    assert made.covariance[j, j] == pytest.approx(expected)
    assert made.unobservable[0]["direction"] == {"gyro_misalignment:xz": 1.0, "gyro_misalignment:yz": 1.0}
    assert dict(zip(made.stages[0].labels, made.stages[0].values, strict=True)) == {
        "gyro_misalignment:xy": -1e-3, "x1": 2.0
    }  # fmt: skip


def test_a_table_that_says_no_format_is_one_of_format_1(tmp_path: Path) -> None:
    path, told = tmp_path / "calibration.csv", ("name", "axis", "value", "sigma", "unit", "effect")
    lines = [",".join(str(row[name]) for name in told) for row in rows()]
    head = "# Direction: physics to reading, as in calibration.json; correlations are not in this file."
    path.write_text("\n".join([head, ",".join(told), *lines, ""]))
    M = matrices(read_calibration(path).effects)["Mg"]
    np.testing.assert_allclose(M, np.eye(3) + np.diag(S) + OFF, rtol=1e-12)
    path.write_text("\n".join([",".join(told), *lines, ""]))  # written by a person of today
    assert matrices(read_calibration(path).effects)["Mg"][0, 0] == pytest.approx(1 / 1.02)
