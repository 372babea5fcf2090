"""What else could stand in a cause's place: significance against regression, twins where two laws coincide."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.diagnose.search.stepwise import stepwise, with_causes
from gimbalcal.diagnose.verdict.judgement import judged_without
from gimbalcal.progress import no_progress
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from tests.diagnose.plant import ARCSEC
from tests.diagnose.rows.test_views import UP, G, unit
from tests.diagnose.small import telescope


def test_a_clear_cause_is_likely_and_alone():
    v = pointing(telescope(1, north=12.0, east=-7.0))
    c = stepwise(v, no_progress)
    (s,) = c.steps
    j = judged_without(c.end, s.cause[0])
    assert j.cause is s.cause[0]
    assert j.confounded == ()
    assert j.probability > 0.95
    # F test of its two columns: what they take away, over what is left
    before, after = (float((m.residual**2).sum()) for m in (c.start, c.end))
    F = (before - after) / (after / (c.end.residual.size - len(c.end.parameters)))
    assert j.significance == pytest.approx(np.sqrt(F), rel=0.1)  # the scale is the likeliest of a grid 15 % wide


def test_two_axes_are_judged_as_all_three_where_the_third_has_left_the_model():
    """They were one cause while the third was in the model; no library holds the two of them alone any more."""
    noise = 1e-4 * np.random.default_rng(5).standard_normal((20, 3))
    rows = norm(unit(G * UP * [1.001, 1.0, 1.0] + 0.02 + noise))
    start = start_with_baseline(rows)
    of_all = next(
        c for c in assemble_library(start).candidates if (c.effect, c.axis) == ("scale_factor_asymmetry", "x, y, z")
    )
    two = replace(of_all, axis="x, z", parameters=tuple(p for p in of_all.parameters if p.axis != "y"))
    j = judged_without(with_causes(start, [(two, of_all.variants[0])]), two)
    assert j.cause is two
    assert j.probability < 0.5  # no sensor is asymmetric


def test_a_weak_cause_is_less_likely():
    v = pointing(telescope(1, north=12.0, east=-7.0))
    strong = stepwise(v, no_progress).causes[0]
    weak = pointing(telescope(1, north=0.3))
    end = with_causes(stepwise(weak, no_progress).start, [strong])
    j = judged_without(end, strong[0])
    assert j.probability < 0.9
    assert j.significance < 4


def low(r, n):
    """Stars in one small part of the sky, where a tilt and others are one constant and one slope."""
    E = 0.7 + 0.05 * (r.channels["true_angle", "elevation"] - 0.7)
    A = 0.05 * r.channels["true_angle", "azimuth"]
    rng = np.random.default_rng(4)
    noise = ARCSEC * rng.standard_normal((2, n))
    slope = 300 * ARCSEC * (E - 0.7)
    channels = {
        ("true_angle", "elevation"): E, ("true_angle", "azimuth"): A,
        ("gimbal_angle", "elevation"): E + 0.1 + slope + noise[0],
        ("gimbal_angle", "azimuth"): A - 0.2 + noise[1] / np.cos(E),
    }  # fmt: skip
    return replace(r, channels=channels)


def test_laws_that_coincide_on_these_rows_are_told_together():
    """A slope in elevation over ten degrees is a bent tube, an eccentric encoder, refraction: whoever is taken up."""
    v = pointing(low(telescope(2), 80))
    c = stepwise(v, no_progress)
    (s,) = c.steps[:1]
    j = judged_without(c.end, s.cause[0])
    assert len(j.confounded) >= 2
    assert s.cause[0].effect not in j.confounded
    assert {"tube_flexure", "encoder_eccentricity", "refraction"} & {s.cause[0].effect, *j.confounded}
    assert 0.85 < j.probability < 0.95  # of all of them together; the rest is that of shapes
