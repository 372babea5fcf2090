"""Views: misfits that vanish at the truth, and derivatives against central differences of the misfit itself."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gimbalcal.diagnose.estimated_noise import judged_diagnosis
from gimbalcal.diagnose.search.stepwise import stepwise
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_at_rest
from gimbalcal.platform import BENCH
from gimbalcal.progress import no_progress
from gimbalcal.recording import Recording, Site
from gimbalcal.views.norm import inverted, norm
from gimbalcal.views.pointing import pointing
from gimbalcal.views.tilting_table import BLOCK_S, means_over_duration, tilting_table
from tests.diagnose.small import telescope
from tests.golden import refused

G = 9.8
RNG = np.random.default_rng(1)
UP = np.array([u / np.linalg.norm(u) for u in RNG.standard_normal((20, 3))])


def unit(force, rate=None):
    """Twenty rests of two readings each."""
    channels = {("specific_force", a): np.repeat(force[:, i], 2) for i, a in enumerate("xyz")}
    if rate is not None:
        channels |= {("angular_rate", a): np.repeat(rate[:, i], 2) for i, a in enumerate("xyz")}
    n = 2 * len(force)
    return Recording("multi-position", "unit", BENCH, Site(None, 0.0, G), {}, 1.0 * np.arange(n),
                     np.repeat(np.arange(1, 21), 2), channels)  # fmt: skip


def tilting(lever=None, tilt=0.1):
    """Twelve seconds at 100 Hz of a table that tilts by `tilt` [rad] about x; a level unit feels (0, 0, -g)."""
    t = np.arange(1200) * 0.01
    rate = np.stack([tilt * np.cos(t), 0 * t, 0 * t], axis=-1)
    angle = tilt * np.sin(t)
    force = -G * np.stack([0 * t, np.sin(angle), np.cos(angle)], axis=-1)
    turn = np.stack([-tilt * np.sin(t), 0 * t, 0 * t], axis=-1)
    if lever is not None:
        force = force + np.cross(turn, lever) + np.cross(rate, np.cross(rate, lever))
    channels = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    channels |= {("angular_rate", a): rate[:, i] for i, a in enumerate("xyz")}
    return Recording("rotation", "table", BENCH, Site(0.7, 0.0, G), {}, t, None, channels)


@cache
def view(name):
    noise = np.random.default_rng(2).standard_normal
    if name == "pointing":
        return pointing(telescope(1))
    if name == "table":
        return tilting_table(tilting())
    made = unit(G * UP * 1.001 + 0.02, 1e-4 * noise((20, 3)))
    if name == "norm":
        return norm(made)
    at_rest = view_at_rest(made)
    assert at_rest is not None
    return at_rest


EFFECTS = {
    "pointing": ("gimbal_zero", "axis_collimation", "base_tilt", "tube_flexure"),
    "norm": ("bias", "scale_factor", "misalignment", "cubic_nonlinearity"),
    "rest rates": ("gyro_bias", "gyro_g_sensitivity_rate"),
    "table": ("bias", "misalignment", "lever_arm"),
}


def wanted(v):
    return tuple(p for i in EFFECTS[v.name] for p in parameters(CATALOGUE[i], v.stimulus.axis_names))


@pytest.mark.parametrize("name", EFFECTS)
def test_the_derivative_is_that_of_the_misfit(name):
    """What a parameter adds to the reading leaves the misfit: r(x + dx) = r(x) - J dx, away from zero too."""
    v = view(name)
    ps = wanted(v)
    sigma, x = np.array([p.sigma for p in ps]), 0.3 * np.array([p.sigma for p in ps])

    def misfit(x):
        return v.linearised(with_values((), ps, x, v.stimulus.axis_names), ())[0]

    r, J = v.linearised(with_values((), ps, x, v.stimulus.axis_names), ps)
    assert r.shape == (len(v), len(v.channels))
    for k, step in enumerate(1e-3 * sigma):
        e = step * np.eye(len(x))[k]
        difference = (misfit(x - e) - misfit(x + e)) / (2 * step)
        # second order of the step, and rounding of forces of 10 in differences of 1e-8
        np.testing.assert_allclose(J[..., k], difference, atol=1e-5 * np.abs(difference).max() + 1e-14 / step)


def test_a_corrected_norm_is_gravity():
    """Readings through an error law written here: biases, which the model has, and a scale of z, which it has not."""
    b = np.array([0.1, -0.2, 0.05])
    y = G * UP * [1.0, 1.0, 1.001] + b
    v = norm(unit(y))
    named = {("bias", "x"): 0.1, ("bias", "y"): -0.2, ("bias", "z"): 0.05}
    ps = tuple(p for p in parameters(CATALOGUE["bias"]))
    effects = with_values((), ps, np.array([named[p.effect, p.axis] for p in ps]))
    r, _ = v.linearised(effects, ())
    np.testing.assert_allclose(r[:, 0], np.linalg.norm(y - b, axis=1) - G, atol=1e-9)
    assert np.abs(r).max() > 5e-3  # of the scale that the model does not hold: 1e-3 g
    none, _ = v.linearised((), ())
    np.testing.assert_allclose(none[:, 0], np.linalg.norm(y, axis=1) - G, atol=1e-9)


def test_rates_at_rest_lose_what_the_effects_say():
    w = 1e-4 * np.random.default_rng(3).standard_normal((20, 3))
    v = view_at_rest(replace(unit(G * UP, w), site=Site(0.0, 0.0, G)))  # nothing turns about the vertical
    ps = parameters(CATALOGUE["gyro_bias"])
    effects = with_values((), ps, np.array([1e-5, 2e-5, -3e-5]))
    np.testing.assert_allclose(v.linearised(effects, ())[0], w - [1e-5, 2e-5, -3e-5], atol=1e-12)


def test_rests_are_judged_where_too_few_turns_were_logged_to_prove_it():
    """A g-sensitivity of 20 deg/h per g at rest; one turn between the rests is no fit of nine parameters."""
    hour = np.pi / 648000
    noise = 0.1 * hour * np.random.default_rng(5).standard_normal((20, 3))
    at, one = unit(G * UP, 20 * hour * UP[:, [1, 2, 0]] + noise), 20  # rows before the one turn that is logged
    channels = {key: np.insert(x, one, np.zeros(20)) for key, x in at.channels.items()}
    begin = np.where(at.position > 10, 1020.0, 0.0) + at.time + 100.0 * at.position
    time = np.insert(begin, one, begin[one - 1] + np.arange(1.0, 21.0))
    time[40:] += time[39] + 1 - time[40]  # at all other turns the clock pauses
    position = np.insert(at.position, one, np.zeros(20, dtype=int))
    r = Recording("multi-position", "unit", BENCH, Site(0.0, 0.0, G), {}, time, position, channels)
    v = view_at_rest(r)
    assert v.missed_by_turns is not None
    found = judged_diagnosis(stepwise(v, no_progress), no_progress)
    assert [f["effect"] for f in found.findings] == ["gyro_g_sensitivity_rate"]
    assert found.fit.turns is None


@pytest.mark.parametrize("vertical", [10.0, 40.0])
def test_the_earth_s_vertical_rate_is_no_g_sensitivity_where_no_latitude_tells_it(vertical):
    """A rate about the vertical of a deg/h remains with a over Omega / sqrt(3) of one sigma in all rests together."""
    hour = np.pi / 648000
    noise = hour * np.random.default_rng(3).standard_normal((20, 3))

    def residual(rate):
        v = view_at_rest(unit(G * UP, rate * hour * UP + [1e-5, 2e-5, -3e-5] + noise))
        return v.linearised((), ())[0]

    remains = residual(vertical) - residual(0.0)
    scatter = float(np.std(residual(0.0) - residual(0.0).mean(axis=0)))
    assert np.linalg.norm(remains) / scatter == pytest.approx(vertical * np.sqrt(3) / 15.041, rel=0.2)
    assert np.linalg.norm(remains) < 0.05 * np.linalg.norm(vertical * hour * UP)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_gyroscope_that_scatters_hides_no_g_sensitivity_of_another_axis(seed):
    """Noise of 30 deg/h in z is no misfit of a clean unit, and 5 deg/h/g of x shows beside it as beside 1 deg/h."""
    hour = np.pi / 648000
    noise = np.random.default_rng(seed).standard_normal((20, 3)) * [1.0, 1.0, 30.0]
    answers = []
    for size in (0.0, 5.0):
        v = view_at_rest(unit(G * UP, hour * (noise + size * UP[:, :1] * [1.0, 0.0, 0.0])))
        assert v is not None
        answers.append(judged_diagnosis(stepwise(v, no_progress), no_progress))
    clean, sensitive = answers
    assert clean.verdict == "adequate"
    (f,) = sensitive.findings
    assert (f.effect, f.axis) == ("gyro_g_sensitivity_rate", "x")
    (xx,) = (p for p in f.parameters if p.axis == "xx")
    assert xx.value == pytest.approx(5.0, abs=3 * xx.sigma)
    assert 0.2 < xx.sigma < 0.8  # 1 deg/h over a component of twenty unit vectors, beside the vertical rate


def test_a_lever_on_a_table_is_known_by_its_centrifugal_and_euler_forces():
    """The force of a unit off the axis, written as cross products, vanishes with the lever of the catalogue."""
    lever = np.array([0.03, -0.05, 0.02])
    v, level = tilting_table(tilting(lever)), tilting_table(tilting())
    ps = parameters(CATALOGUE["lever_arm"])
    effects = with_values((), ps, np.array([lever["xyz".index(p.axis)] for p in ps]))
    with_it, without = v.linearised(effects, ())[0], v.linearised((), ())[0]
    rest = level.linearised((), ())[0]  # what tilting itself does to the force: no effect of the sensors
    assert np.abs(without - rest).max() > 1e-3
    assert np.abs(with_it - rest).max() < 1e-2 * np.abs(without - rest).max()
    assert np.abs(with_it.mean(axis=0)).max() < 1e-12  # the mean force is not known


def test_the_tilt_of_a_step_is_no_lever_arm():
    """Adding up mean rates in steps of 0.04 s leaves g h^2 / 12, 1.3 mm of a lever arm; no 0.1 mm are left."""
    v = tilting_table(tilting(tilt=1e-4))
    (leakage,), lever = parameters(CATALOGUE["gravity_leakage"]), parameters(CATALOGUE["lever_arm"])
    misfit, J = v.linearised(with_values((), (leakage,), np.ones(1)), [p for p in lever if p.axis == "z"])
    assert np.abs(misfit).max() < 1e-4 * np.abs(J).max()


def test_rates_that_tilt_far_more_than_the_force_are_refused():
    r = tilting()
    fast = {key: 57.3 * x if key[0] == "angular_rate" else x for key, x in r.channels.items()}
    with refused():
        tilting_table(replace(r, channels=fast))


def test_blocks_are_means_and_a_last_short_one_is_left_out():
    r = tilting()
    r = r.select(slice(0, 1150))
    made = means_over_duration(r, BLOCK_S)
    assert len(made.time) == 11
    np.testing.assert_allclose(made.time, np.arange(11) + 0.495)
    np.testing.assert_allclose(made.weight, 100.0)
    y = r.channels["specific_force", "y"]
    np.testing.assert_allclose(made.channels["specific_force", "y"][3], y[300:400].mean())


@pytest.mark.parametrize("law", [lambda f: 1.02 * f + 1e-3 * f**2, lambda f: f + 1e-4 * f**3 + 0.1])
def test_a_law_is_inverted_with_its_derivative(law):
    truth = G * UP
    f, H = inverted(law, law(truth))
    np.testing.assert_allclose(f, truth, rtol=1e-12, atol=1e-12)
    e = 1e-6
    slope = (law(truth + e) - law(truth - e)) / (2 * e)
    np.testing.assert_allclose(np.einsum("nii->ni", H), slope, rtol=1e-8)
    assert np.abs(H - np.einsum("ni,ij->nij", slope, np.eye(3))).max() < 1e-8


def test_what_remembers_the_rest_before_stands_in_the_norm_beside_the_scale_factors():
    """A sensor that its own power warms follows the forces of other rows: all columns then go through all rows."""
    v = norm(unit(G * UP))
    warmth, scale = (parameters(CATALOGUE[i]) for i in ("self_heating", "scale_factor"))
    size = np.array([p.sigma for p in warmth])
    X = v.evaluate(with_values((), warmth, size)).jacobian(scale)
    assert X.shape == (20, 1, 3)
    np.testing.assert_allclose(X, v.evaluate(()).jacobian(scale), rtol=1e-3, atol=1e-3 * G)
