"""Calibrations in other programs' files and back, with the direction each file states."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.io import loadmat

from gimbalcal.calibration import Calibration, Counts, Readout, Residual
from gimbalcal.calibration.exchange import FORMATS, export, read_calibration, read_exchange
from gimbalcal.calibration.matrices import LINEAR, matrices
from gimbalcal.effects import CATALOGUE, Effect, parameters, values, with_values
from gimbalcal.errors import InputError
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from tests.golden import refused

G = 9.8
OF_SENSORS = [kind for kind in FORMATS if kind != "tpoint"]  # that one is of mounts: test_tpoint.py


def made_of(names, seed=1, size=1.0):
    rng = np.random.default_rng(seed)
    wanted = tuple(p for n in names for p in parameters(CATALOGUE[n]))
    x = np.array([p.sigma for p in wanted]) * rng.uniform(-size, size, len(wanted))
    sigma = np.array([p.sigma for p in wanted]) / 100
    effects: tuple[Effect, ...] = with_values((), wanted, x)
    return Calibration("test", effects, wanted, np.diag(sigma**2), (), Residual(0.0, 0, {}))


def shaken(n=20):
    rng = np.random.default_rng(0)
    channels = {("specific_force", a): G * rng.uniform(-1, 1, n) for a in "xyz"}
    channels |= {("angular_rate", a): rng.uniform(-2, 2, n) for a in "xyz"}
    return Recording("rotation", "shaken", BENCH, Site(gravity=G), {}, np.arange(float(n)), None, channels)


def readings(r):
    return r.triad("specific_force"), r.triad("angular_rate")


@pytest.mark.parametrize("kind", [kind for kind in OF_SENSORS if kind != "json"])
def test_linear_parameters_come_back(kind, tmp_path):
    made = made_of(LINEAR)
    assert export(made, kind, tmp_path / "file") == ()
    back = read_exchange(kind, tmp_path / "file")
    found = dict(zip(((p.name, p.axis) for p in back.parameters), back.values, strict=True))
    for p, v in zip(made.parameters, made.values, strict=True):
        # a few roundings of numbers of order one, inverted and factorised
        assert found[p.name, p.axis] == pytest.approx(v, abs=1e-14 * max(1.0, abs(v) / p.sigma)), p.label
    assert [f.name for f in tmp_path.iterdir()] == ["file"]


def test_the_kalibr_equations_corrupt(tmp_path):
    made = made_of(LINEAR)
    export(made, "kalibr", tmp_path / "imu.yaml")
    text = (tmp_path / "imu.yaml").read_text()
    assert text.startswith("# Direction: physics to reading.")
    imu = yaml.safe_load(text)["imu0"]
    f, w = readings(shaken())
    Ma, Mg, A, C = (
        np.array(m) for m in (imu["accelerometers"]["M"], *(imu["gyroscopes"][k] for k in ("M", "A", "C_gyro_i")))
    )
    read_f, read_w = readings(made.corrupt(shaken()))
    np.testing.assert_allclose(f @ Ma.T + imu["gimbalcal"]["accelerometer_bias"], read_f, rtol=1e-13)
    np.testing.assert_allclose(w @ (Mg @ C).T + f @ A.T + imu["gimbalcal"]["gyroscope_bias"], read_w, rtol=1e-12)
    np.testing.assert_allclose(C @ C.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.triu(Mg, 1), 0, atol=1e-15)


def test_the_psins_equations_correct(tmp_path):
    made = made_of((*LINEAR, "scale_nonlinearity"))
    export(made, "psins", tmp_path / "clbt.mat")
    clbt = loadmat(tmp_path / "clbt.mat", struct_as_record=False, squeeze_me=True)["clbt"]
    read = made.corrupt(shaken())
    y, v = readings(read)
    f, w = readings(made.apply(read))
    # Ka2 acts outside Ka: what is left is misalignment times second order, 6e-4 x 3e-5 x g^2 / g
    np.testing.assert_allclose(y @ clbt.Ka.T - clbt.db - clbt.Ka2 * y**2, f, atol=1e-6)
    np.testing.assert_allclose(v @ clbt.Kg.T - clbt.eb - y @ clbt.gSens.T, w, atol=1e-9)  # gSens on readings: G x 1e-4
    back = read_exchange("psins", tmp_path / "clbt.mat")
    for p, x in zip(made.parameters, made.values, strict=True):
        assert values(back.effects, (p,))[0] == pytest.approx(x, abs=1e-6 * p.sigma)  # products of two errors


def test_what_a_format_cannot_hold_is_said(tmp_path):
    made = made_of(("bias", "cubic_nonlinearity"))
    assert export(made, "kalibr", tmp_path / "a") == ("kalibr has no term for cubic_nonlinearity: it is omitted",)
    assert "# kalibr has no term for cubic_nonlinearity" in (tmp_path / "a").read_text()
    assert export(made, "csv", tmp_path / "b") == ()


def test_csv_keeps_every_parameter_and_its_sigma(tmp_path):
    names = tuple(n for n in ("bias", "cubic_nonlinearity", "gyro_scale_asymmetry", "warm_up"))
    made = made_of(names)
    export(made, "csv", tmp_path / "c.csv")
    back = read_exchange("csv", tmp_path / "c.csv")
    assert back.parameters == made.parameters
    np.testing.assert_allclose(back.values, made.values, rtol=1e-15)
    np.testing.assert_allclose(back.sigmas, made.sigmas, rtol=1e-15)


def test_the_size_effect_of_a_kalibr_file_is_read(tmp_path):
    (tmp_path / "k.yaml").write_text("imu0:\n  accelerometers:\n    ry_i: [0.01, -0.02, 0.03]\n  update_rate: 200.0\n")
    found = read_exchange("kalibr", tmp_path / "k.yaml")
    arms = {p.axis: v for p, v in zip(found.parameters, found.values, strict=True)}
    assert [arms["yx"], arms["yy"], arms["yz"]] == pytest.approx([0.01, -0.02, 0.03])


def test_foreign_yaml_in_block_style_is_read(tmp_path):
    text = """imu0:
  accelerometers:
    M:
    - [1.01, 0.0, 0.0]
    - [0.002, 0.99, 0.0]
    - [0.003, -0.001, 1.02]
  gyroscopes:
    A:
    - - 0.0
      - 0.0
      - 1.0e-05
    - [0.0, 0.0, 0.0]
    - [0.0, 0.0, 0.0]
    M:
    - [1.0, 0.0, 0.0]
    - [0.0, 1.003, 0.0]
    - [0.0, 0.0, 1.0]
  model: scale-misalignment
  rostopic: /imu0
  update_rate: 200.0
"""
    (tmp_path / "k.yaml").write_bytes("# 20 °C\n".encode("latin-1") + text.encode())
    m = matrices(read_exchange("kalibr", tmp_path / "k.yaml").effects)
    np.testing.assert_allclose(m["Ma"], [[1.01, 0, 0], [0.002, 0.99, 0], [0.003, -0.001, 1.02]], atol=1e-15)
    assert m["A"][0, 2] == 1e-5
    assert m["Mg"][1, 1] == pytest.approx(1.003)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("kalibr", "cam0:\n  x: 1\n"),
        ("kalibr", "imu0:\n  accelerometers:\n    M: [1, 2, 3]\n"),
        ("kalibr", "imu0:\n  accelerometers:\n    M: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n  gyroscope:\n    M: [1]\n"),
        ("kalibr", "imu0:\n  accelerometers:\n    N: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"),
        ("kalibr", "imu0:\n  gyroscopes:\n    C_gyro: [1, 0, 0]\n"),
        ("kalibr", "imu0:\n  gyroscopes:\n    M: [1, 0, 0, 0, one, 0, 0, 0, 1]\n"),
        ("kalibr", "imu0:\n  gyroscopes: [1, 2]\n"),
        ("kalibr", "imu0: {gyroscopes: {}}\nimu1: {gyroscopes: {}}\n"),
        ("psins", "text"),
        ("csv", "name,axis,value\n"),
        ("csv", "name,axis,value,unit\nspin,x,1,ug\n"),
        ("csv", "name,axis,value,unit\nbias,x,many,ug\n"),
        ("csv", "name,axis,value,unit\nbias,x,nan,ug\n"),
        ("csv", "name,axis,value,sigma,unit\nbias,x,1,-1,ug\n"),
        ("csv", "name,axis,value,unit\nbias,x,1,ug\nbias,x,2,ug\n"),
        ("csv", "name,axis,value,unit\nscale_nonlinearity,x,13,ug/g\n"),
        ("csv", "name,axis,value,unit\nbias,x,1,ug,5\n"),
        ("tpoint", "mount\nIH 1 1\nID 2 1\n"),
        ("tpoint", "mount\nT 30 10.02.0\nCH 5 1\nEND\n"),
        ("tpoint", "mount\nIH 1 1e400\nEND\n"),
        ("tpoint", "mount\nIH 1 1\nID 1,5 2\nEND\n"),
        ("tpoint", "mount\nIH 1 1\nid 1 2\nEND\n"),
        ("tpoint", "mount\nIH 1 1\nIH 2 1\nEND\n"),
        ("tpoint", "mount\nIH 1 1e308\nEND\n"),
        ("kalibr", f"imu0:\n  gyroscopes:\n    M: [{'9' * 400}, 0, 0, 0, 1, 0, 0, 0, 1]\n"),
    ],
)
def test_a_file_that_cannot_be_read_is_one_sentence(kind, text, tmp_path):
    path = tmp_path / "file"
    path.write_text(text)
    with refused():
        read_exchange(kind, path)


def test_unknown_formats_and_files(tmp_path):
    with refused():
        export(made_of(("bias",)), "xml", tmp_path / "x")
    with refused():
        read_exchange("csv", tmp_path / "nothing")
    (tmp_path / "file").write_text("imu0: [1, 2\n")
    with pytest.raises(InputError, match="is not YAML"):
        read_exchange("kalibr", tmp_path / "file")


@pytest.mark.parametrize("kind", OF_SENSORS)
def test_a_file_is_told_by_its_ending(kind, tmp_path):
    made = made_of(LINEAR)
    export(made, kind, tmp_path / FORMATS[kind].file)
    back = read_calibration(tmp_path / FORMATS[kind].file)
    read = made.corrupt(shaken())
    # as above: 1e-14 of the parameters; the largest of them bend a reading of order ten by 1e-3
    np.testing.assert_allclose(readings(back.apply(read))[0], readings(shaken())[0], atol=1e-12)


def test_the_scale_of_counts_is_said_to_be_lost(tmp_path):
    counted = replace(made_of(LINEAR), readout=Readout(Counts((1.0, 1.0, 1.0))))
    assert export(counted, "json", tmp_path / "a") == ()
    for kind in set(OF_SENSORS) - {"json"}:
        assert "nominal scale of counts" in export(counted, kind, tmp_path / "b")[0]


@pytest.mark.parametrize("place", ["name", "0.5"])
def test_a_table_with_a_field_of_any_length_is_refused_in_one_sentence(tmp_path, place):
    path = tmp_path / "calibration.csv"
    path.write_text("name,axis,value,sigma,unit\nbias,x,0.5,0.1,m/s^2\n".replace(place, "9" * 200_000))
    with pytest.raises(InputError, match="is not CSV: field larger"):
        read_calibration(path)
