"""Advice: expected log Bayes factors against dense algebra, and the manoeuvre that physics asks for."""

import numpy as np
import pytest

from gimbalcal.design.manoeuvres import available_manoeuvres, second_pass
from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.verdict import separation as module
from gimbalcal.diagnose.verdict.separation import SETTLED_NATS, Advice, advise_manoeuvre, expected_separation
from gimbalcal.earth import EARTH_RATE
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.small import at_rest, columns_at, covariance, few, observed, rows_of

TABLE = observed(1, dwell=3)
REST = at_rest(1)


def planned_rows(r, o):
    """The rows of a planned recording about the model of a fit."""
    ids = tuple(dict.fromkeys(p.effect for p in o.parameters))
    return fit_baseline(view_at_known_attitude(r, ids, o.effects), o.effects, steps=0)


REVERSED, LATER, OBLIQUE, OTHER, WARMER = (m.words for m in available_manoeuvres(TABLE.view.source))


def causes(o, *labels):
    return few(o, *labels).candidates


def misfit_of_the_other(o, found, size, other):
    """Half the least chi^2 that calibration and the other cause, at any size and constants, leave of this signal."""
    V = covariance(nominal_noise(o), len(rows_of(o)[0]))
    root = np.linalg.inv(np.linalg.cholesky(V))
    signal = root @ columns_at(o, found, found.variants[0].constants) @ size
    out = []
    for v in other.variants:
        A = root @ np.concatenate([rows_of(o)[0], columns_at(o, other, v.constants)], axis=1)
        A = A / (np.linalg.norm(A, axis=0) + 1e-300)
        out.append(np.sum((signal - A @ np.linalg.lstsq(A, signal, rcond=1e-8)[0]) ** 2) / 2)
    return float(min(out))


@pytest.mark.parametrize(
    ("found", "other"),
    [("gimbal_friction:inner", "encoder_eccentricity:inner"), ("bias_temperature:x", "bias_temperature_lagged:x"),
     ("bias_drift:x", "warm_up:x")],
)  # fmt: skip
def test_separation_is_what_the_other_cause_cannot_follow(found, other):
    i, j = causes(TABLE, found, other)
    size = np.arange(1.0, 1 + len(i.parameters))
    here = expected_separation(TABLE, (i, i.variants[0]), size, j)
    assert here == pytest.approx(misfit_of_the_other(TABLE, i, size, j), rel=1e-5)
    assert expected_separation(TABLE, (i, i.variants[0]), 3 * size, j) == pytest.approx(9 * here, rel=1e-9)
    planned = planned_rows(second_pass(TABLE.view.source, reverse=True), TABLE)
    needed = misfit_of_the_other(planned, i, size, j)
    assert expected_separation(planned, (i, i.variants[0]), size, j) == pytest.approx(needed, rel=1e-5)


def test_a_cause_is_not_told_from_itself():
    (c,) = causes(TABLE, "cross_coupling:y")
    assert expected_separation(TABLE, (c, c.variants[0]), np.ones(len(c.parameters)), c) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("found", "other", "words"),
    [
        # friction has the sign of the way by which an angle is reached, eccentricity that of the angle alone
        ("gimbal_friction:inner", "encoder_eccentricity:inner", REVERSED),
        # f^3 and f |f| are the same at 0 and 1 g; at 0.71 g, which some positions have, they nearly are
        ("cubic_nonlinearity:x", "odd_quadratic:x", OBLIQUE),
        # a warmer room would say more in the end, and takes two hours more
        ("post_move_creep:x", "bias_temperature:x", REVERSED),
    ],
)
def test_the_manoeuvre_is_the_one_that_brings_most_per_hour(found, other, words):
    i, j = causes(TABLE, found, other)
    size = np.full(len(i.parameters), 80.0)
    a = advise_manoeuvre(TABLE, (i, i.variants[0]), size, j)
    rate = {}
    for m in available_manoeuvres(TABLE.view.source):
        rate[m.words] = misfit_of_the_other(planned_rows(m.apply(TABLE.view.source), TABLE), i, size, j) / m.hours
    assert a.words == words == max(rate, key=lambda k: rate[k])
    assert a.ln_bayes / a.hours == pytest.approx(rate[words], rel=1e-5)


def test_a_long_static_run_is_planned_with_fewer_rows(monkeypatch):
    ramp, day = causes(REST, "bias_drift:x", "bias_temperature:x")
    whole = advise_manoeuvre(REST, (ramp, ramp.variants[0]), np.array([1.0]), day)
    monkeypatch.setattr(module, "MAX_PLANNED_ROWS", 144)
    half = advise_manoeuvre(REST, (ramp, ramp.variants[0]), np.array([1.0]), day)
    assert half.ln_bayes == pytest.approx(whole.ln_bayes, rel=0.02)  # every second row stands for two


def test_a_manoeuvre_that_brings_too_little_is_not_advised():
    """The expected ln Bayes factor goes with the square of the size: just above three nats, and just below."""
    i, j = causes(TABLE, "gimbal_friction:inner", "encoder_eccentricity:inner")
    best = advise_manoeuvre(TABLE, (i, i.variants[0]), np.array([20.0]), j)
    enough = 20.0 * np.sqrt(SETTLED_NATS / best.ln_bayes)
    assert advise_manoeuvre(TABLE, (i, i.variants[0]), np.array([1.001 * enough]), j).words == REVERSED
    assert advise_manoeuvre(TABLE, (i, i.variants[0]), np.array([0.999 * enough]), j) == Advice("", 0.0, 0.0)


def test_manoeuvres_are_what_they_are_called():
    r = TABLE.view.source
    n = len(r.time)
    for m in available_manoeuvres(r):
        made = m.apply(r)
        assert len(made.time) == 2 * n
        assert np.all(np.diff(made.time) > 0)
        np.testing.assert_array_equal(made.position[:n], r.position)
        again = made.position[n:]
        np.testing.assert_array_equal(again, r.position[::-1] if m.words == REVERSED else r.position)
        warmer = made.channels["temperature", ""][n:].mean() - r.channels["temperature", ""].mean()
        assert warmer == pytest.approx(6.0 if m.words == WARMER else 0.0, abs=1e-9)
        waited = made.time[n] - made.time[n - 1]
        assert waited > 6 * 3600 if m.words == LATER else waited < 6 * 3600
    mirrored = next(m for m in available_manoeuvres(r) if m.words == OTHER).apply(r).angles()
    down = SPACE_STABLE.attitude(mirrored) @ np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(down[n:], down[:n], atol=1e-12)  # the same attitudes to gravity
    np.testing.assert_allclose(mirrored[n:, 1] - mirrored[:n, 1], np.pi)  # by another inner angle
    oblique = next(m for m in available_manoeuvres(r) if m.words == OBLIQUE).apply(r).angles()
    np.testing.assert_allclose(oblique[n:], 2 / 3 * oblique[:n])  # 45 and 90 degrees become 30 and 60


def test_a_static_run_goes_on_as_the_earth_turns():
    r = REST.view.source
    (m,) = available_manoeuvres(r)
    made, n = m.apply(r), len(r.time)
    assert np.ptp(made.time) == pytest.approx(2 * np.ptp(r.time) + np.diff(r.time)[0])
    assert np.ptp(np.diff(made.time)) < 1e-6
    turn = made.channels["gimbal_angle", "platform"][n:] - made.channels["gimbal_angle", "platform"][:n]
    np.testing.assert_allclose(turn, EARTH_RATE * (made.time[n:] - made.time[:n]), rtol=1e-12)
    np.testing.assert_array_equal(made.channels["gimbal_angle", "middle"][n:], r.channels["gimbal_angle", "middle"])


def test_twice_the_run_tells_a_ramp_from_a_day():
    """Two days hold a ramp and a daily wave apart, four days better."""
    ramp, day = causes(REST, "bias_drift:x", "bias_temperature:x")
    a = advise_manoeuvre(REST, (ramp, ramp.variants[0]), np.array([1.0]), day)
    here = expected_separation(REST, (ramp, ramp.variants[0]), np.array([1.0]), day)
    assert a.words == "let the run go on as long again"
    assert a.ln_bayes > 4 * here  # the variance of a slope falls with the cube of the time
