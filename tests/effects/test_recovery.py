"""Does a fit find an effect again where it is seen, and name it where it is not? In every kind of recording."""

import numpy as np
import pytest

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.units import from_si
from tests.effects.recordings import RECORDINGS, experienced, ready, unknowns

ALL = sorted(CATALOGUE)
SIGMA = {
    "specific_force": 2e-6 * G0, "angular_rate": 1e-7, "gimbal_angle": 2e-6, "attitude_error": 2e-6, "pointing": 5e-6,
}  # fmt: skip
OF_PRIOR = {"gravity_leakage": 0.01}  # of a unit that tilts a little; the table swings by radians
CASES = [(n, k) for n in ALL for k in RECORDINGS if k in CATALOGUE[n].kinds]


def test_every_effect_is_looked_for_in_every_kind_of_recording_that_it_names():
    assert {k for _, k in CASES} == {k for n in ALL for k in CATALOGUE[n].kinds}
    assert {n for n, _ in CASES} == set(ALL)


def rows(platform, s, effects, wanted, kind):
    """Whitened prediction (m,) and Jacobian (m, p)."""
    h, J = predict(platform, s, effects, kind), jacobian(platform, s, effects, wanted, kind)
    return (
        np.concatenate([(h[c] / SIGMA[c]).ravel() for c in h]),
        np.concatenate([(J[c] / SIGMA[c]).reshape(-1, len(wanted)) for c in h]),
    )


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_is_recovered_where_it_is_seen_and_named_where_it_is_not(name, kind):
    recording, rng = RECORDINGS[kind], np.random.default_rng([9, len(name)])
    platform, s = recording.platform, experienced(kind)
    own = unknowns(name, constants=False, kind=kind)
    base = tuple(p for i in BASELINE[kind] if i != name for p in parameters(CATALOGUE[i], platform.axis_names))
    wanted = base + own
    # a fifth of the prior, so that iteration starts inside the linear range of every law
    truth = np.array([p.sigma for p in wanted]) * np.where([p in own for p in wanted], 1.0, 0.2)
    truth *= rng.standard_normal(len(wanted)) * np.where([p in own for p in wanted], 0.0, 1.0) + np.array(
        [float(p in own) for p in wanted]
    )
    truth *= [OF_PRIOR.get(p.effect, 1.0) for p in wanted]
    y = rows(platform, s, with_values((ready(name, kind),), wanted, truth, platform.axis_names), wanted, kind)[0]
    y = y + rng.standard_normal(y.size)
    x = np.zeros(len(wanted))
    for _ in range(3):
        h, J = rows(platform, s, with_values((ready(name, kind),), wanted, x, platform.axis_names), wanted, kind)
        solution = solve(information(J, y - h + J @ x, wanted))
        x = solution.x
    seen_part = J @ (x - truth)
    rank = len(wanted) - len(solution.unobservable)
    # chi^2 of `rank` degrees of freedom at 4 sigma (normal approximation, generous), plus what hides below one sigma
    assert seen_part @ seen_part < rank + 4 * np.sqrt(2 * rank) + 16 + 2 * len(solution.unobservable)
    named = {label for u in solution.unobservable for label in u.direction}
    for p, value, sigma, true in zip(wanted, x, solution.sigma, truth, strict=True):
        if p in own and p.label not in named:
            assert abs(value - true) < 4 * sigma, f"{p.label}: {from_si(value, p.unit)} against {from_si(true, p.unit)}"
    for p in own:
        if hidden(J, wanted, p) < 0.5:  # less than half a sigma of it is left once everything else has been fitted
            assert p.label in named, f"{p.label} is invisible and the fit does not say so"


def hidden(J, wanted, p):
    """What is left, in sigma, of one prior sigma of p when the other parameters imitate it by moves of some sigmas.

    Without the limit (ten prior sigmas count as one sigma of misfit) a column that is almost invisible would imitate
    anything, by thousands of its sigmas.
    """
    scaled = J * np.array([q.sigma for q in wanted])
    i = wanted.index(p)
    rest = np.vstack([np.delete(scaled, i, axis=1), 0.1 * np.eye(len(wanted) - 1)])
    target = np.concatenate([scaled[:, i], np.zeros(len(wanted) - 1)])
    return float(np.linalg.norm(target - rest @ np.linalg.lstsq(rest, target, rcond=None)[0]))
