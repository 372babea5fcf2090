"""The sigmas of gravity and latitude: of the ellipsoid, as stated, and where the stated value is anomalous."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.recording import read, write
from gimbalcal.recording.site import ANOMALY, UNKNOWN_HEIGHT, gravity_anomaly, with_gravity_stated, with_normal_gravity
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import find
from gimbalcal.views.known_attitude import readings

L = np.deg2rad(48.0)
HERE = float(normal_gravity(L, 500.0))


def test_the_gravity_of_the_ellipsoid_is_good_to_anomalies_and_to_the_height():
    known = with_normal_gravity(L, 500.0)
    assert (known.gravity, known.gravity_sigma) == (HERE, 3e-4)  # 30 mGal
    unknown = with_normal_gravity(L, None)
    assert unknown.gravity_sigma == pytest.approx(np.hypot(ANOMALY, UNKNOWN_HEIGHT))
    assert unknown.gravity - HERE == pytest.approx(500 * 3.086e-6, rel=0.01)  # 0.3086 mGal each metre
    assert with_normal_gravity(None, None).gravity_sigma > 10 * unknown.gravity_sigma


def test_a_stated_gravity_is_exact_unless_it_is_anomalous_or_its_sigma_is_stated():
    usual, strange = HERE + 2 * ANOMALY, HERE - 4e-3
    assert with_gravity_stated(L, 500.0, usual, None).gravity_sigma == 0.0
    assert with_gravity_stated(L, 500.0, strange, None).gravity_sigma == pytest.approx(4e-3)
    assert with_gravity_stated(L, 500.0, strange, 1e-6).gravity_sigma == 1e-6
    assert with_gravity_stated(None, None, strange, None).gravity_sigma == 0.0
    assert gravity_anomaly(with_gravity_stated(L, 500.0, strange, 0.0)) == pytest.approx(-4e-3)
    assert gravity_anomaly(with_gravity_stated(L, 500.0, usual, 0.0)) == 0.0


def test_the_sigma_of_a_latitude_is_read_and_written_with_a_static_run(tmp_path):
    static, _ = simulate(shorter("wu2018-static"), 1)
    write(replace(static, site=replace(static.site, latitude_sigma=np.radians(1e-3))), tmp_path / "run")
    assert "latitude = { value = " in (tmp_path / "run" / "recording.toml").read_text(encoding="utf-8")
    assert read(tmp_path / "run").site.latitude_sigma == pytest.approx(np.radians(1e-3))
    header = tmp_path / "run" / "recording.toml"
    header.write_text(header.read_text(encoding="utf-8").replace("sigma = 0.001", "sigma = -0.001"), encoding="utf-8")
    with pytest.raises(InputError, match="the sigma of latitude is"):
        read(tmp_path / "run")


def test_a_latitude_without_a_sigma_is_said_to_be_taken_as_exact(tmp_path):
    static, _ = simulate(shorter("wu2018-static"), 1)
    write(static, tmp_path / "exact")
    assert not read(tmp_path / "exact").remarks
    write(replace(static, site=replace(static.site, latitude_sigma=None)), tmp_path / "run")
    (remark,) = read(tmp_path / "run").remarks
    run = readings(static)
    moved = run.by_latitude()[:, run.columns("specific_force")[0], 0] * np.radians(1 / 60)
    level = np.max(np.abs(moved)) / (static.site.gravity * np.cos(static.site.latitude))
    assert float(re.search(r"by (\d+) ppm", remark)[1]) == pytest.approx(1e6 * level, rel=0.01)


def test_a_sigma_of_the_latitude_that_nothing_takes_into_account_is_refused(tmp_path):
    positions, _ = simulate(shorter("wu2018-18"), 1)
    write(replace(positions, site=replace(positions.site, latitude_sigma=np.radians(1e-3))), tmp_path / "run")
    with pytest.raises(InputError, match="in a static run alone"):
        read(tmp_path / "run")


def shorter(name):
    scenario = tomllib.loads(find(name).read_text(encoding="utf-8"))
    if "duration" in scenario["schedule"]:
        scenario["schedule"] |= {"duration": {"value": 12, "unit": "h"}, "rate": {"value": 1 / 600, "unit": "Hz"}}
    return scenario
