"""One sigma of each row: it becomes a weight, positions and stars are weighed by it, and slips are refused."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.recording import read
from tests.golden import refused

G = 9.80665
COLUMNS = """\
t = { quantity = "time", unit = "s" }
p = { quantity = "position" }
x = { quantity = "specific_force", axis = "x", unit = "m/s^2" }
y = { quantity = "specific_force", axis = "y", unit = "m/s^2" }
z = { quantity = "specific_force", axis = "z", unit = "m/s^2" }
"""
SIGMA = 's = { quantity = "sigma", of = "specific_force", unit = "mg" }\n'
SCALE = np.array([3e-3, -2e-3, 1e-3])


def positions(seed):
    """Mean forces of 24 positions [m/s^2] and the sigma of each [mg]: every other one is ten times worse."""
    rng = np.random.default_rng(seed)
    up = rng.standard_normal((24, 3))
    up *= G / np.linalg.norm(up, axis=1, keepdims=True)
    sigma = np.where(np.arange(24) % 2, 0.5, 5.0)
    return up * (1 + SCALE) + 1e-3 * G * sigma[:, None] * rng.standard_normal((24, 3)), sigma


def recording(path, force, sigma, columns=COLUMNS + SIGMA, head=""):
    kind = 'kind = "multi-position"' if "kind" not in head else ""
    (path / "recording.toml").write_text(f"format = 1\n{kind}\n{head}\n[columns]\n{columns}")
    n = np.arange(len(force))
    rows = np.column_stack([10.0 * n, n + 1, force, sigma])
    (path / "samples.csv").write_text("t,p,x,y,z,s\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows))
    return read(path)


def test_the_median_is_the_noise_and_the_others_weigh_by_it(tmp_path):
    force, _ = positions(1)
    sigma = np.where(np.arange(24) < 16, 2.0, 4.0)
    made = recording(tmp_path, force, sigma)
    assert made.noise == {"accelerometer": pytest.approx(2e-3 * G)}
    np.testing.assert_allclose(made.weight, (2.0 / sigma) ** 2)
    assert ("sigma", "") not in made.channels


def test_positions_are_weighed_by_their_sigma(tmp_path):
    errors: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(4):
        made = recording(tmp_path, *positions(seed))
        for weighed in errors:
            used = made if weighed else replace(made, weight=np.ones(24), noise={})
            found = multiposition(used, ("bias", "scale_factor"))
            x = [v for p, v in zip(found.parameters, found.values, strict=True) if p.effect == "scale_factor"]
            errors[weighed] += list(np.array(x) - (1 / (1 + SCALE) - 1))
    rms = {weighed: float(np.sqrt(np.mean(np.square(e)))) for weighed, e in errors.items()}
    assert rms[True] < 0.35 * rms[False]


def test_stars_are_weighed_by_their_sigma(tmp_path):
    rng = np.random.default_rng(3)
    n = 40
    az, el = rng.uniform(0, 360, n), rng.uniform(20, 80, n)
    sigma = np.where(np.arange(n) % 2, 1.0, 30.0)
    off = np.array([40.0, -25.0])[:, None] + sigma * rng.standard_normal((2, n))  # arcsec, azimuth and elevation
    rows = np.column_stack(
        [np.arange(n), az, el, az + off[0] / 3600 / np.cos(np.radians(el)), el + off[1] / 3600, sigma]
    )
    (tmp_path / "samples.csv").write_text("t,a,e,ta,te,s\n" + "\n".join(",".join(map(str, r)) for r in rows))
    (tmp_path / "recording.toml").write_text("""\
format = 1
kind = "pointing"
platform = { name = "alt-az" }
[columns]
t = { quantity = "time", unit = "s" }
a = { quantity = "gimbal_angle", axis = "azimuth", unit = "deg" }
e = { quantity = "gimbal_angle", axis = "elevation", unit = "deg" }
ta = { quantity = "true_angle", axis = "azimuth", unit = "deg" }
te = { quantity = "true_angle", axis = "elevation", unit = "deg" }
s = { quantity = "sigma", of = "true_angle", unit = "arcsec" }
""")
    made = read(tmp_path)
    weighed, alike = (
        pointing_calibration([r], ("gimbal_zero",)) for r in (made, replace(made, weight=np.ones(n), noise={}))
    )
    zero = [
        next(v for p, v in zip(c.parameters, c.values, strict=True) if p.axis == "elevation") for c in (weighed, alike)
    ]
    miss = np.abs(np.degrees(zero) * 3600 + 25.0)
    assert miss[0] < 1.0
    assert miss[1] > 2.0
    assert weighed.sigmas.max() < 0.2 * alike.sigmas.max()


@pytest.mark.parametrize(
    ("columns", "head"),
    [
        (COLUMNS + SIGMA.replace('of = "specific_force", ', ""), ""),
        (COLUMNS + SIGMA.replace("specific_force", "angular_rate").replace("mg", "deg/h"), ""),
        (COLUMNS + SIGMA.replace("mg", "deg"), ""),
        (COLUMNS.replace('axis = "x"', 'axis = "x", of = "time"') + SIGMA, ""),
        (COLUMNS + SIGMA, '[noise]\naccelerometer = { value = 1, unit = "mg" }'),
        (COLUMNS.replace('p = { quantity = "position" }\n', "") + SIGMA, 'kind = "rotation"'),
    ],
)
def test_slips(tmp_path, columns, head):
    with refused():
        recording(tmp_path, *positions(1), columns, head)


def test_a_sigma_of_nothing_is_refused_with_its_line(tmp_path):
    force, sigma = positions(1)
    sigma[7] = 0.0
    with refused():
        recording(tmp_path, force, sigma)
