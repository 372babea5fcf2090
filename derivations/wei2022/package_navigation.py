"""The package's Earth, aids, alignment and budget for the paper's navigation, Eqs. (9) to (11), and its sisters'."""

from __future__ import annotations

from typing import Any

from derivations import navigator_at_rest as rest
from derivations import passes
from derivations.comparison import checks
from derivations.wei2022.symbols import SOURCE, STATES

STARS = "navigate.space_stable_navigator"

checks(SOURCE, "Eq. (9)", "Eq. (10)", where="earth.rate_at")(rest.earth_rate)
checks(SOURCE, "Eq. (11)", where="earth.radii")(rest.earth_radii)
checks(SOURCE, "Eq. (10)", where="earth.normal_gravity", tolerance=1e-10)(rest.normal_gravity)
checks(SOURCE, "Eq. (10)", where=f"{STARS}._loop_constants", tolerance=1e-7)(rest.loops)
checks(SOURCE, "Eq. (10)", "Eq. (11)", where="navigate.strapdown.aided_strapdown", tolerance=1e-5)(rest.aided_strapdown)
checks(SOURCE, "Eq. (10)", "Eq. (11)", where=f"{STARS}._run_loop", tolerance=1e-6)(rest.aided_among_the_stars)
checks(SOURCE, "Eq. (11)", where=f"{STARS}._at_rest")(rest.still_among_the_stars)
checks(SOURCE, "Eq. (9)", where="navigate.strapdown_unit._in_carried_axes", tolerance=1e-4)(rest.coarse_alignment)
checks(SOURCE, "Eq. (9)", where="navigate.strapdown_unit.aligned_attitude", tolerance=1e-6)(rest.alignment)
checks(SOURCE, "Eq. (11)", where="navigate.static_run.horizontal_distance")(rest.metres)
checks(SOURCE, "Eq. (23)", where="design.budget", tolerance=1e-9)(rest.parts_of_budget)
checks(SOURCE, "Eq. (23)", where="navigate.uncertainty._sampled_sigma", tolerance=1e-9)(rest.sampled_sigma)


# --- the filter of constants

MODEL, PASS = "estimate.systematic.error_model.stretch_model", "estimate.systematic.filter_pass.filter_and_smooth"
checks(SOURCE, "Eq. (12)", "Eq. (17)", where=MODEL, tolerance=1e-4)(passes.stretch)
checks(SOURCE, "Eq. (12)", "Eq. (17)", where=MODEL, tolerance=1e-4)(passes.stretch_by_biases)
checks(SOURCE, "Eq. (12)", "Eq. (17)", where=MODEL, tolerance=1e-6)(passes.end_of_stretch)
checks(SOURCE, "Eq. (14)", "Eq. (18)", "Eq. (21)", where=PASS, tolerance=5e-2)(passes.first_step)


@checks(SOURCE, "Eq. (13)", where="estimate.systematic.state_lists")
def number_of_states() -> float:
    """How many of the 21 constants the package's 30 states lack, and how many it has besides."""
    from gimbalcal.estimate.systematic.state_lists import states

    rows: Any = passes._recording([0.0] * 6)
    return float(abs(len(states("30", rows.why_not_shown)) - len(STATES)))
