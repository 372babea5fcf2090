"""Effects that remember: the states they name, integrated step by step, are what they add."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.history import Dynamics, integrated, states
from gimbalcal.effects.process import GaussMarkov, RandomWalk
from tests.effects.stimulus import VISIT, example, given

REMEMBER = sorted(name for name in CATALOGUE if example(name).dynamics(given()) is not None)
LOOKS_AHEAD = {"bias_temperature_rate"}  # smooths to both sides: nothing that runs along can carry it
EXACT = 1e-9  # rounding, and a sinusoid of a day taken as straight over two seconds
SINUSOID = "gyro_diurnal_drift"  # straight between samples only where they are close


def on(time):
    """The random stimulus at other times, dwells and moves agreeing with them; the first dwell began earlier."""
    s = given()
    first = np.searchsorted(VISIT, VISIT)
    return s.at(time=time, since_move=time - time[first] + 7.0 * (VISIT == 0))


def irregular(step, seed=3):
    time = np.cumsum(np.random.default_rng(seed).uniform(0.1 * step, 2 * step, len(VISIT)))
    return time - time[0]


def step_by_step(d, time):
    """x' = A x + B u by the matrix exponential (Van Loan 1978) for u straight between two samples."""
    m = d.drive.shape[1]
    A, B = (np.zeros((m, m)), np.eye(m)) if d.tau is None else (-np.eye(m) / d.tau, np.eye(m) / d.tau)
    zero, unit = np.zeros((m, m)), np.eye(m)
    start = np.broadcast_to(d.start, d.drive.shape)
    x = [start[0]]
    for k, (t, later) in enumerate(pairwise(time)):
        h = later - t
        Phi = expm(h * np.block([[A, B, zero], [zero, zero, unit], [zero, zero, zero]]))[:m]
        slope = (d.drive[k + 1] - d.drive[k]) / h
        x.append(Phi @ np.concatenate([x[-1], d.drive[k], slope]))
        if d.anew is not None and d.anew[k + 1]:
            x[-1] = start[k + 1]
    return np.asarray(d.output * np.array(x))


def off_its_states(name):
    """Largest difference of the integrated states from the contribution, as a share of the largest contribution."""
    off = []
    for step in (1.0,) if name == SINUSOID else (1.0, 2000.0):
        s, made = on(irregular(step)), example(name)
        d, expected = made.dynamics(s), made.contribution(s)
        off += [
            np.abs(x - expected).max() / np.abs(expected).max()
            for x in (step_by_step(d, s.time), integrated(d, s.time))
        ]
    return float(np.max(off))


@pytest.mark.parametrize("name", REMEMBER)
def test_integrated_dynamics_are_the_contribution(name):
    assert off_its_states(name) < EXACT


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_whatever_depends_on_the_past_names_its_states(name):
    """A change of force, rate, temperature and covariates in two early rows, means kept, that shows in the last row."""
    s, made = on(irregular(60.0)), example(name)
    early = np.zeros(len(s.time))
    early[2:4] = 1.0, -0.3  # not the same area before and behind
    balanced = early.copy()
    balanced[4] = -0.7  # covariates count from their mean
    other = s.at(
        force=s.force + early[:, None], rate=s.rate + early[:, None], temperature=s.temperature + early,
        covariates={k: v + np.std(v) * balanced for k, v in s.covariates.items()},
    )  # fmt: skip
    size = np.abs(made.contribution(s)).max()
    remembers = np.abs(made.contribution(other) - made.contribution(s))[-1].max() > 1e-12 * size
    assert not remembers or name in REMEMBER or name in LOOKS_AHEAD


def test_the_effects_that_a_navigator_has_to_integrate_are_among_them():
    drifts = {"gyro_drift", "gyro_g_sensitivity", "gyro_g2_sensitivity", "gyro_temperature_drift", "gyro_diurnal_drift"}
    late = {"bias_temperature_lagged", "bias_covariate_lagged", "self_heating", "warm_up", "post_move_creep"}
    assert set(REMEMBER) >= drifts | late


@pytest.mark.parametrize("name", [n for n in REMEMBER if "tau" in vars(example(n))])
def test_states_relax_as_noise_of_the_same_time_constant_does(name):
    s, made = on(irregular(500.0)), example(name)
    d = made.dynamics(s)
    assert d.tau is not None
    h, still = np.diff(s.time), np.zeros(len(s.time) - 1, dtype=bool)
    left = np.cumprod(GaussMarkov(1.0, d.tau).transition(h, still)[:, 0])
    free = states(Dynamics(np.zeros((len(s.time), 1)), np.ones(1), tau=d.tau), s.time)[1:, 0]
    np.testing.assert_allclose(free, left, rtol=1e-12)


def test_what_adds_up_is_kept_as_a_random_walk_is():
    time = irregular(60.0)
    kept = states(Dynamics(np.zeros((len(time), 1)), np.ones(1)), time)[1:]
    still = np.zeros(len(time) - 1, dtype=bool)
    np.testing.assert_array_equal(kept, np.cumprod(RandomWalk(1.0).transition(np.diff(time), still), axis=0))
