"""The catalogue describes what the plant does: every law lies in the columns of the effect that names it."""

from functools import cache

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.effects import CATALOGUE
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.law_plants import PROBE, at_size, laws, oddities
from tests.diagnose.plant import record, strength

NAMES = sorted(laws(0))
AXIS = {name: n % 3 for n, name in enumerate(NAMES)}


@cache
def setting(logged):
    """Fit of a clean recording, its library, and the basis of its calibration."""
    o = fit_baseline(
        view_at_known_attitude(record(np.random.default_rng(1), laws(0)["fan"].error if logged else None, 0.0))
    )
    found = assemble_library(o)
    node = nominal_noise(o)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    X = node.whiten(found.X)
    return o, found, node, Q, X - Q @ (Q.T @ X)


def profiled(error, size, logged):
    """What an effect does to the whitened rows beyond the calibration (R,)."""
    o, _, node, Q, _ = setting(logged)
    with_it, without = (record(np.random.default_rng(1), error, s) for s in (size, 0.0))
    d = (with_it.triad("specific_force") - without.triad("specific_force")) / o.sigma
    y = node.whiten(o.reduced(d[:, :, None]))[:, 0]
    return y - Q @ (Q.T @ y)


def explained(y, law, logged):
    """Largest share of y that one of the named candidates takes, whatever its constants."""
    _, found, _, _, X = setting(logged)
    shares = [0.0]
    for c in found.candidates:
        if c.effect in law.ids and law.axis in c.axis:
            for v in c.variants:
                fit = X[:, v.index] @ np.linalg.lstsq(X[:, v.index], y, rcond=1e-9)[0]
                shares.append(float(fit @ y / (y @ y)))
    return max(shares)


@pytest.mark.parametrize("name", NAMES)
def test_the_catalogue_spans_what_the_plant_does(name):
    law = laws(AXIS[name])[name]
    assert set(law.ids) <= set(CATALOGUE)
    y = profiled(law.error, PROBE * 4, name == "fan")
    # lags and knees lie between two values of the grid; a dead zone bends with its size
    assert explained(y, law, name == "fan") > (0.85 if law.bent else 0.97)


@pytest.mark.parametrize("name", sorted(oddities(0)))
def test_an_oddity_is_nothing_that_the_catalogue_holds(name):
    y = profiled(oddities(1)[name], PROBE * 4, logged=False)
    _, found, _, _, X = setting(False)
    shares = [0.0]
    for c in found.candidates:
        for v in [] if c.rival else c.variants:
            fit = X[:, v.index] @ np.linalg.lstsq(X[:, v.index], y, rcond=1e-9)[0]
            shares.append(float(fit @ y / (y @ y)))
    assert max(shares) < 0.9


@pytest.mark.parametrize("name", ["cubic", "dead zone", "skew"])
def test_an_effect_has_the_strength_that_was_asked_for(name):
    law = laws(1)[name]
    recording, size = at_size(3, law, 30.0)
    assert recording.kind == "multi-position"
    found = strength(lambda s: record(np.random.default_rng(3), law.error, s), size)
    assert found == pytest.approx(30.0, rel=0.03)  # four secant steps where it bends
