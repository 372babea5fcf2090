"""Which turn to record next: the sigma it promises against that of a calibration with it, and goals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gimbalcal
from gimbalcal.design.next_turn import next_turn
from gimbalcal.history import StoredResult, keep
from gimbalcal.schedule.file import read_rotation
from gimbalcal.units import from_si
from tests.golden import refused
from tests.paths import DEVICE

NOISE = {
    "accelerometer": {"value": 16.0, "unit": "ug"},
    "gyroscope": {"value": 0.4, "unit": "deg/h"},
    "velocity": {"value": 0.01, "unit": "mm/s"},
}
FEW = [("x", 90.0), ("x", 90.0), ("z", 90.0), ("y", 180.0), ("z", -90.0), ("x", 90.0)]


def session(start, moves, seed):
    """A unit without errors, turned at 10 deg/s with stops of 40 s."""
    scenario: dict[str, Any] = {
        "format": 1, "kind": "rotation", "title": f"session {seed}", "seed": seed,
        "site": {"latitude": {"value": 45.0, "unit": "deg"}}, "noise": NOISE, "truth": {},
        "schedule": {
            "start": start, "rate": {"value": 10.0, "unit": "Hz"}, "slew_rate": {"value": 10.0, "unit": "deg/s"},
            "dwell": {"value": 40.0, "unit": "s"},
            "moves": [{"axis": axis, "angle": {"value": angle, "unit": "deg"}} for axis, angle in moves],
        },
    }  # fmt: skip
    return gimbalcal.simulate(scenario)[0]


@pytest.fixture(scope="module")
def few():
    return session({"x": "east", "y": "north", "z": "up"}, FEW, 1)


def test_the_promised_sigma_is_that_of_a_calibration_with_the_session(few):
    plan = next_turn([few], "30")
    made = gimbalcal.calibrate([few], states="30")
    at = {p.label: i for i, p in enumerate(plan.parameters)}
    determined = [p for p in made.parameters if p.label in at and p.label not in str(made.unobservable)]
    assert len(determined) > 12
    step = plan.steps[0]
    ((axis, angle),) = step.angles.items()
    directions = dict(part.split(" ") for part in step.words.split(";")[0].split(", "))
    missing = next(a for a in "xyz" if a not in directions)
    start = {**directions, missing: _third(directions)}
    both = gimbalcal.calibrate([few, session(start, [(axis, angle)], 2)], states="30")
    named = next(p for p in both.parameters if f"{p.name} {p.axis}".strip() == step.parameter)
    sigma = float(from_si(both.sigmas[both.parameters.index(named)], named.unit))
    assert sigma == pytest.approx(step.sigma_after, rel=0.15)
    assert step.sigma_after < 0.7 * step.sigma_now
    hourly = [s.reduction / s.seconds for s in plan.steps]
    assert hourly == sorted(hourly, reverse=True)


def _third(start):
    """The direction of the axis that is left, right-handed: x, y, z."""
    vectors = {"north": (1, 0, 0), "south": (-1, 0, 0), "east": (0, 1, 0), "west": (0, -1, 0),
               "down": (0, 0, 1), "up": (0, 0, -1)}  # fmt: skip
    missing = next(a for a in "xyz" if a not in start)
    before, after = (start["xyz"[("xyz".index(missing) + k) % 3]] for k in (1, 2))
    v = tuple(np.cross(vectors[before], vectors[after]))
    return next(name for name, w in vectors.items() if w == v)


def test_goals_of_turns(few):
    far = next_turn([few], "30", reach=read_rotation("wei2022-30"), most=1)
    assert not far.reached
    assert len(far.not_reached) > 5
    apart = next_turn([few], "30", separate=["gyro_g_sensitivity_rate:xx"], most=2)
    assert apart.separation is not None
    assert all((s.separation or 0.0) >= apart.separation for s in apart.steps)
    alone, twice = next_turn([few], "30").sigma, next_turn([few, replace(few, title="again")], "30").sigma
    assert np.all(twice <= alone * (1 + 1e-9))
    known = {p.label: 1e-3 * p.sigma for p in next_turn([few], "30").parameters}
    assert np.all(next_turn([few], "30", prior=known).sigma <= np.array(list(known.values())) * (1 + 1e-9))


def test_what_does_not_go_with_turns_is_refused(few):
    with refused():
        gimbalcal.next_step(few, grade="consumer")
    with refused():
        gimbalcal.next_step(few, states="77")
    with refused():
        gimbalcal.next_step(few, states="30", separate="bias:q")
    with refused():
        gimbalcal.next_step(DEVICE, states="30")


def test_a_fleet_is_the_prior_of_what_is_planned(tmp_path):
    """Six units of which all scale factors agree to some ppm: the dwells so far say less of them than the fleet."""
    store, unit = tmp_path / "units.db", gimbalcal.read(DEVICE)
    made = gimbalcal.calibrate(unit)
    for k in range(6):
        content = replace(made, provenance=replace(made.provenance, recordings=())).to_dict()
        keep(store, StoredResult(f"unit {k}", f"2026-01-0{k + 1}T00:00:00+00:00", "calibration", content))
    first = unit.select(unit.position <= 4)
    alone, known = gimbalcal.next_step(first), gimbalcal.next_step(first, grade=f"fleet:{store}")
    assert np.all(known.sigma <= alone.sigma * (1 + 1e-9))
    scale = [p.label for p in known.parameters].index("scale_factor:x")
    assert known.sigma[scale] < 0.05 * alone.sigma[scale]
