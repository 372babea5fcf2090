"""Gyroscopes on a rate table, of a plant written here: mounted three ways, rates up and down, the Earth below."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import calibrate
from gimbalcal.effects.loading import temporarily_loaded
from gimbalcal.estimate.gyroscopes.rate_table import MOUNTING_SIGMA_RAD, gyroscopes_on_a_table
from gimbalcal.methods import usual_method
from gimbalcal.pipeline import load
from gimbalcal.platform import Axis, Platform
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.record import Source
from gimbalcal.report.calibration_page import calibration_report
from gimbalcal.rotation import exponential
from tests.golden import golden_text, refused

DEG, HOUR, EARTH, LATITUDE = np.pi / 180, np.pi / 648000, 7.292115e-5, 48 * np.pi / 180
STEP = 0.02
RATES = (5, -5, 20, -20, 50, -50, 100, -100)  # deg/s
# chains of an axis that is vertical and lies along the unit's x, y or z: the base's z points down
CHAINS = {
    "x": (Axis("table", "x"), Axis("base", "y", 1, np.pi / 2)),
    "y": (Axis("table", "y"), Axis("base", "x", 1, -np.pi / 2)),
    "z": (Axis("table", "z"),),
}
GAIN = np.array([1.004, 0.997, 1.001])
CROSS = np.array([[0, 2e-3, -1e-3], [1.5e-3, 0, 5e-4], [-8e-4, 1.2e-3, 0]])
BIAS = np.array([72.0, -108.0, 36.0]) * HOUR


def run(along, seed = 1, *, noise = 0.02 * DEG, tilt = None, asymmetry = 0.0,
        sense = 1, tables = True, force = False):  # fmt: skip
    """Ten seconds at each rate and ten at rest between, read at the end of each step; `tilt` (3,) of the mounting."""
    ramp = 50
    rates = np.concatenate([x for w in RATES for x in (np.zeros(250), np.linspace(0, w, ramp), np.full(500, w),
                                                       np.linspace(w, 0, ramp))])  # fmt: skip
    w = DEG * rates
    angle = np.concatenate([[0.0], np.cumsum((w[1:] + w[:-1]) / 2 * STEP)])
    t = np.arange(len(w)) * STEP
    platform = Platform("own", CHAINS[along])
    C = platform.attitude(np.stack([angle, *([0 * angle] * (len(CHAINS[along]) - 1))], axis=-1))
    axis = np.eye(3)["xyz".index(along)]
    true = w[:, None] * axis + C @ (EARTH * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)]))
    true = true @ exponential(np.zeros(3) if tilt is None else tilt)  # with its cosine
    y = true @ (np.diag(GAIN) @ (np.eye(3) + CROSS)).T + BIAS + asymmetry * np.abs(true)
    y = y + noise * np.random.default_rng(seed).standard_normal(y.shape)
    channels = {("angular_rate", a): y[:, i] for i, a in enumerate("xyz")}
    if force:
        channels |= {("specific_force", a): -9.81 * C[:, i, 2] for i, a in enumerate("xyz")}
    if tables:
        read = {"table": sense * angle, "base": 0 * angle}
        channels |= {("gimbal_angle", a.name): read[a.name] for a in CHAINS[along]}
    return Recording("rotation", f"{along} up", platform, Site(LATITUDE, 0.0, 9.81), {}, t, None, channels)


OWN = '''"""An effect of a user: a torque of the poles of a motor, and a current that is switched."""

import numpy as np

from gimbalcal.effects.effect import Effect, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array


@effect
class OwnMotor(Effect):
    r"""Poles and switch of a motor. .. math:: a sin 8 theta + b s. Source: own. Magnitude: 50 deg/h. Seen by: time."""

    id = "own_motor"
    says = "{who} follows the motor, by {size}"
    stage = Stage.GYROSCOPE
    channel = "angular_rate"
    kinds = ("rotation",)
    a: Array = parameter(("x", "y", "z"), unit="deg/h", sigma=100.0, name="own_poles")
    b: Array = parameter(("x", "y", "z"), unit="deg/h", sigma=100.0, name="own_switch")

    def contribution(self, s: Stimulus) -> Array:
        """Eight cycles in a turn, and seven seconds of a cycle."""
        angle = s.angle[:, -1] if s.angle.shape[1] else 0 * s.time
        switch = np.where(np.mod(s.time / 7.0, 1.0) < 0.5, 1.0, -1.0)
        return self.a * np.sin(8 * angle)[..., None] + self.b * switch[..., None]
'''


def truth():
    """The constants of the plant as the catalogue has them, from readings without noise."""
    made = gyroscopes_on_a_table([run(a, noise=1e-12) for a in "xyz"])
    return dict(zip((p.label for p in made.parameters), made.values, strict=True))


def test_three_mountings_tell_bias_scale_and_misalignments():
    made = gyroscopes_on_a_table([run(a, seed=k, force=True) for k, a in enumerate("xyz")])
    x = dict(zip((p.label for p in made.parameters), made.values, strict=True))
    sigma = dict(zip((p.label for p in made.parameters), np.sqrt(np.diag(made.covariance)), strict=True))
    for i, a in enumerate("xyz"):
        assert abs(x[f"gyro_bias:{a}"] - BIAS[i]) < 4 * sigma[f"gyro_bias:{a}"] < 0.1 * abs(BIAS[i])
        assert abs(abs(x[f"gyro_scale_factor:{a}"]) - abs(GAIN[i] - 1)) < 4 * sigma[f"gyro_scale_factor:{a}"] + 2e-5
        assert sigma[f"gyro_scale_factor:{a}"] < 3e-5
    cross = [s for name, s in sigma.items() if "misalignment" in name]
    assert len(cross) == 6
    np.testing.assert_allclose(cross, MOUNTING_SIGMA_RAD, rtol=0.2)


def test_corrected_readings_are_the_table_s_rates():
    """The mounting apart, what the calibration leaves of another run is its noise; before it was 0.4 deg/s."""
    made = gyroscopes_on_a_table([run(a, seed=k) for k, a in enumerate("xyz")])
    for along in "xyz":
        again = run(along, seed=9, noise=0.0)
        rates = made.apply(again).triad("angular_rate")
        ideal = np.gradient(again.channels["gimbal_angle", "table"], STEP)
        i = "xyz".index(along)
        steady = np.abs(np.gradient(ideal, STEP)) < 1e-9
        off = (rates[:, i] - ideal)[steady]
        assert np.abs(off).max() < 0.004 * DEG + EARTH


def test_a_force_without_any_noise_is_searched_for_rests():
    assert load([run("z", force=True)])[0].remarks == ()


def test_errors_are_as_large_as_stated():
    """Over forty draws of noise and of how the unit is bolted on.

    What a mounting turns aside reaches a scale factor through the misalignments of the unit: what they measure beyond
    the sigma of the mountings, which they hold too.
    """
    known, z = truth(), []
    for k in range(40):
        rng = np.random.default_rng(100 + k)
        tilts = MOUNTING_SIGMA_RAD * rng.standard_normal((3, 3))
        made = gyroscopes_on_a_table([run(a, seed=1000 * k + j, tilt=tilts[j]) for j, a in enumerate("xyz")])
        error = made.values - np.array([known[p.label] for p in made.parameters])
        z.append(error / np.sqrt(np.diag(made.covariance)))
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    size = {of: rms[[p.effect == of for p in made.parameters]] for of in {p.effect for p in made.parameters}}
    assert 0.85 < np.sqrt(np.mean(size["gyro_bias"] ** 2)) < 1.15
    assert 0.85 < np.sqrt(np.mean(size["gyro_misalignment"] ** 2)) < 1.15
    assert 0.8 < np.sqrt(np.mean(size["gyro_scale_factor"] ** 2)) < 1.15


def test_one_mounting_tells_one_column_and_names_the_others():
    made = gyroscopes_on_a_table([run("y")])
    told = {p.label for p in made.parameters}
    assert told == {*(f"gyro_bias:{a}" for a in "xyz"), "gyro_scale_factor:y", *(n for n in told if "misal" in n)}
    assert len(told) == 6
    unseen = {name: u["why"] for u in made.unobservable for name in u["direction"]}
    assert "none about x and z" in unseen["gyro_scale_factor:x"]


def test_an_asymmetry_is_taken_up_and_none_is_where_none_is():
    with_it = gyroscopes_on_a_table([run(a, seed=k, asymmetry=300e-6) for k, a in enumerate("xyz")])
    found = {p.axis: v for p, v in zip(with_it.parameters, with_it.values, strict=True)
             if p.effect == "gyro_scale_asymmetry"}  # fmt: skip
    np.testing.assert_allclose([found[a] for a in "xyz"], 300e-6, atol=4e-5)
    for k in range(10):
        clean = gyroscopes_on_a_table([run(a, seed=10 * k + j) for j, a in enumerate("xyz")])
        assert {p.effect for p in clean.parameters} == {"gyro_bias", "gyro_scale_factor", "gyro_misalignment"}


@pytest.mark.parametrize(("noise", "error"), [(0.02 * DEG, 4.0), (1e-4 * DEG, 0.02)])
def test_what_changes_within_a_stretch_is_fitted_within_it(noise, error):
    """An error of eight cycles in a turn is nothing in the mean of a stretch, a square wave is another size there.

    Within a part of a stretch it is averaged: to `error` sigmas, or to this share of it where there is hardly noise.
    """
    r = run("z", noise=noise)
    angle = r.channels["gimbal_angle", "table"]
    wave = 40 * HOUR * np.where(np.mod(r.time / 7.0, 1.0) < 0.5, 1.0, -1.0)
    r = r.with_channels({
        ("angular_rate", "z"): r.channels["angular_rate", "z"] + 50 * HOUR * np.sin(8 * angle),
        ("angular_rate", "y"): r.channels["angular_rate", "y"] + wave,
    })  # fmt: skip
    with temporarily_loaded("own.py", OWN):
        made = calibrate([r], more=["own_motor:y", "own_motor:z"])
    found = {(e.parameter.name, e.parameter.axis): e for e in made.estimates}
    for (name, axis), truth in ((("own_poles", "z"), 50.0), (("own_switch", "y"), 40.0)):
        own = found[name, axis]
        assert abs(own.value - truth) < error * (own.sigma if error > 1 else truth)
        assert own.sigma < 0.1 * truth
    assert "16 stretches" in made.provenance.options.in_words


def test_counts_get_their_size_from_the_table():
    size = np.array([2e-5, 2.1e-5, 1.9e-5])
    counted = []
    for k, a in enumerate("xyz"):
        r = run(a, seed=k)
        own = {("angular_rate", b): r.channels["angular_rate", b] / size[i] for i, b in enumerate("xyz")}
        units = {("angular_rate", b): "count" for b in "xyz"}
        counted.append(replace(r.with_channels(own), units=units))
    made = gyroscopes_on_a_table(counted)
    np.testing.assert_allclose(made.readout.gyroscopes.scale, size / GAIN, rtol=3e-5)
    scale = [v for p, v in zip(made.parameters, made.values, strict=True) if p.effect == "gyro_scale_factor"]
    assert np.abs(scale).max() < 1e-4  # the nominal size holds it
    with refused():
        gyroscopes_on_a_table(counted[:1])


def test_a_wandering_bias_widens_the_sigmas_and_is_said():
    def drifting(a, k):
        r = run(a, seed=k, noise=1e-4 * DEG)
        walk = np.cumsum(np.random.default_rng(k).standard_normal(len(r.time))) * 2e-4 * DEG
        return r.with_channels({("angular_rate", "x"): r.channels["angular_rate", "x"] + walk})

    made = gyroscopes_on_a_table([drifting(a, k) for k, a in enumerate("xyz")])
    golden_text(made.outcome)
    sigma = dict(zip((p.label for p in made.parameters), np.sqrt(np.diag(made.covariance)), strict=True))
    assert sigma["gyro_bias:x"] > 5 * sigma["gyro_bias:z"]


def standing():
    r = run("x")
    return r.with_channels({("gimbal_angle", "table"): 0 * r.time})


@pytest.mark.parametrize(
    "made",
    [
        lambda: [run("x", sense=-1)],
        lambda: [run("x", tables=False)],
        lambda: [standing()],
        lambda: [run("x").select(slice(0, 20))],
        lambda: [r.select(slice(253, 300)) for r in [run("x")]],
    ],
)
def test_what_cannot_be_taken_is_one_sentence(made):
    with refused():
        gyroscopes_on_a_table(made())


def simple(r, **changed):
    """The same as one writes it who knows the table's axis and no more: nothing says how the table stands."""
    chain = (replace(r.platform.axes[0], **changed),)
    return replace(r, platform=Platform("own", chain), channels={k: x for k, x in r.channels.items() if k[1] != "base"})


def test_without_accelerometers_nothing_says_which_way_is_up():
    """The Earth's 11 deg/h along the table's axis went into the biases, with either sign: 12 sigma and more."""
    made = gyroscopes_on_a_table([simple(run(a, seed=k)) for k, a in enumerate("xyz")])
    x = dict(zip((p.label for p in made.parameters), made.values, strict=True))
    sigma = dict(zip((p.label for p in made.parameters), np.sqrt(np.diag(made.covariance)), strict=True))
    for i, a in enumerate("xyz"):
        assert abs(x[f"gyro_bias:{a}"] - BIAS[i]) < 4 * sigma[f"gyro_bias:{a}"] < 5 * HOUR
    one = gyroscopes_on_a_table([simple(run("x"))])
    sigma = dict(zip((p.label for p in one.parameters), np.sqrt(np.diag(one.covariance)), strict=True))
    assert sigma["gyro_bias:x"] > 8 * HOUR  # as large as what is not known
    assert sigma["gyro_bias:y"] < 2 * HOUR


def test_accelerometers_tell_how_the_table_stands_whatever_its_drawing_says():
    made = gyroscopes_on_a_table([simple(run("x", force=True))])
    x = dict(zip((p.label for p in made.parameters), made.values, strict=True))
    sigma = dict(zip((p.label for p in made.parameters), np.sqrt(np.diag(made.covariance)), strict=True))
    assert abs(x["gyro_bias:x"] - BIAS[0]) < 4 * sigma["gyro_bias:x"] < 8 * HOUR


def test_the_same_mounting_twice_tells_no_more_than_once():
    runs = [simple(run("x", seed=k)) for k in (1, 2)]
    once, twice = gyroscopes_on_a_table(runs[:1]), gyroscopes_on_a_table(runs)
    wide = [dict(zip((p.label for p in c.parameters), np.sqrt(np.diag(c.covariance)), strict=True))
            for c in (once, twice)]  # fmt: skip
    for name in ("gyro_bias:x", "gyro_misalignment:yz", "gyro_misalignment:zy", "gyro_scale_factor:x"):
        assert wide[1][name] > 0.95 * wide[0][name]
    rows = replace(runs[0], source=(Source("x", "1"),))
    with refused():
        gyroscopes_on_a_table([rows, rows])
    told = {p.label for p in twice.parameters}
    assert "gyro_scale_factor:x" in told
    unseen = {name: u["why"] for u in twice.unobservable for name in u["direction"]}
    assert "none about y and z" in unseen["gyro_scale_factor:y"]


def test_a_sloppy_mounting_is_in_the_sigma_of_a_lone_scale_factor():
    """Its cosine, and what misalignments make of it: 30 ppm here were 20 sigma of noise."""
    sloppy = gyroscopes_on_a_table([simple(run("x", tilt=np.array([0.0, 0.0097, 0.0055])))])
    x = dict(zip((p.label for p in sloppy.parameters), sloppy.values, strict=True))
    sigma = dict(zip((p.label for p in sloppy.parameters), np.sqrt(np.diag(sloppy.covariance)), strict=True))
    off = x["gyro_scale_factor:x"] - truth()["gyro_scale_factor:x"]
    assert 2e-5 < abs(off) < 2 * sigma["gyro_scale_factor:x"] < 2e-4


def said(r, quantity, unit, factor):
    """Columns in a unit that is not theirs."""
    own = {k: factor * x if k[0] == quantity else x for k, x in r.channels.items()}
    return replace(r, channels=own, units={k: unit for k in own if k[0] == quantity})


def wrapped(r):
    key = ("gimbal_angle", "table")
    return r.with_channels({key: r.channels[key] % (2 * np.pi)})


def exchanged(r):
    x, y = (r.channels["angular_rate", a] for a in "xy")
    return r.with_channels({("angular_rate", "x"): y, ("angular_rate", "y"): -x})


@pytest.mark.parametrize(
    "made",
    [
        lambda: simple(run("x"), direction="y"),
        lambda: simple(run("x", sense=-1), direction="z"),
        lambda: simple(run("x"), sign=-1),
        lambda: said(simple(wrapped(run("y"))), "gimbal_angle", "rad", 1 / DEG),
        lambda: said(simple(run("y")), "gimbal_angle", "deg", DEG),
        lambda: said(simple(run("z")), "angular_rate", "rad/s", 1 / DEG),
        lambda: exchanged(run("x")),
    ],
)
def test_slips_of_one_mounting_are_named(made):
    with refused():
        gyroscopes_on_a_table([simple(run("z", seed=3)), made()])


def test_gyroscopes_alone_on_a_table_need_no_method_named():
    assert usual_method([run("x"), run("y")]) == "rate-table"


def test_the_page_draws_what_is_left_over_the_rate():
    recordings = [run(a, seed=k) for k, a in enumerate("xyz")]
    made = gyroscopes_on_a_table(recordings)
    page = calibration_report(made, recordings)
    assert "rate of the table" in page
    assert page.count("rms</text>") >= 6
