"""How many positions `gimbalcal next` takes, asked after every dwell, on a simulated bench.

    python -m tests.benchmarks.bench_next

A space-stable platform of navigation grade, ten minutes a position, 10 ug a sample at 0.1 Hz, settings good to 1
arcsec. The first dwell is position 1 of Wu et al. (2018); each further one is the first step that `next_step` names,
with the sigmas of their 18 positions to be reached. At the end the positions are simulated with a truth, and
calibrated: its sigmas and errors are those of data, not of a plan. The second part goes on from the 18 positions until
two effects are separated, by the expected ln Bayes factor 3 between them.
"""

from dataclasses import replace

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration
from gimbalcal.design.next_step import REACHED_RATIO, SETTLED_NATS, next_step
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.schedule import EIGHTEEN_POSITIONS, Hold, Schedule
from gimbalcal.views.positions import planned_recording
from tests.benchmarks.collecting import say

DWELL_S, SAMPLES, MOST = 600.0, 60, 60
NOISE = {"accelerometer": 10e-6 * 9.80665, "gimbal_angle": float(np.deg2rad(1 / 3600))}
PAIRS = (("cubic_nonlinearity:z", "odd_quadratic:z"), ("scale_nonlinearity:z", "quadratic_nonlinearity:z"))
SIZES = (1.0, 3.0, 10.0)  # times the usual one


def dwells(angles: list[Array]) -> Recording:
    """A recording of dwells at these angles [rad], whose readings do not matter."""
    holds = tuple(Hold(tuple(map(float, a)), DWELL_S) for a in angles)
    plan = planned_recording(Schedule("bench", EIGHTEEN_POSITIONS.platform, holds), float(SAMPLES))
    return replace(plan, noise=NOISE)


def sequence(reach: Schedule, most: int = MOST) -> list[tuple[int, float, list[Array]]]:
    """Number of positions, the largest sigma over that of `reach`, and the angles, after every dwell."""
    angles, out = [EIGHTEEN_POSITIONS.angles[0]], []
    while len(angles) <= most:
        plan = next_step([dwells(angles)], reach=reach, most=1)
        assert plan.target is not None
        out.append((len(angles), float((plan.sigma / plan.target).max()), list(angles)))
        if plan.reached or not plan.steps:
            break
        names = EIGHTEEN_POSITIONS.platform.axis_names
        angles.append(np.radians([plan.steps[0].angles[name] for name in names]))
    return out


def calibrated(angles: list[Array], seed: int) -> tuple[Calibration, Array]:
    """The calibration of simulated dwells at these angles, and the truth (p,) of its parameters in SI."""
    names = EIGHTEEN_POSITIONS.platform.axis_names
    holds = [dict(zip(names, np.rad2deg(a).tolist(), strict=True)) for a in angles]
    content = {
        "format": 1, "kind": "multi-position", "title": "bench", "seed": seed,
        "site": {"latitude": {"value": 40.0, "unit": "deg"}}, "platform": {"name": "space-stable"},
        "schedule": {"dwell": {"value": 10.0, "unit": "min"}, "rate": {"value": 0.1, "unit": "Hz"}, "holds": holds},
        "truth": {"draw": True, "factor": 0.5},
        "noise": {"accelerometer": {"value": 10.0, "unit": "ug"}, "gimbal_angle": {"value": 1.0, "unit": "arcsec"}},
    }  # fmt: skip
    recording, truth = gimbalcal.simulate(content)
    made = gimbalcal.calibrate(recording)
    return made, gimbalcal.effects.values(truth, made.parameters)


def to_separate(pair: tuple[str, ...], step: float, size: float, most: int = MOST) -> int | None:
    """How many positions after the 18 separate two effects of this size, in times the usual one; None beyond `most`."""
    angles = list(EIGHTEEN_POSITIONS.angles)
    for more in range(most + 1):
        plan = next_step([dwells(angles)], separate=pair, step=step, most=1)
        assert plan.separation is not None
        if plan.separation * size**2 >= SETTLED_NATS:
            return more
        if not plan.steps:
            return None
        names = EIGHTEEN_POSITIONS.platform.axis_names
        angles.append(np.radians([plan.steps[0].angles[name] for name in names]))
    return None


def main() -> None:
    """Print both tables."""
    steps = sequence(EIGHTEEN_POSITIONS)
    say("Positions chosen one after the other: largest sigma over that of the 18 published positions\n")
    say("positions  ratio")
    for n, ratio, _ in steps:
        if n >= 6:
            say(f"{n:9d}  {ratio:5.2f}")
    within = {limit: next((n for n, ratio, _ in steps if ratio <= limit), None) for limit in (2.0, 1.2, REACHED_RATIO)}
    say("\n" + "; ".join(f"within a factor of {limit:g}: {n or 'not'} positions" for limit, n in within.items()))
    chosen, truth = calibrated(steps[-1][2], 1)
    published, _ = calibrated(list(EIGHTEEN_POSITIONS.angles), 1)
    unseen = {label for u in chosen.null_directions for label in u.direction}
    keep = [i for i, p in enumerate(chosen.parameters) if p.label not in unseen]
    ratio = (chosen.sigmas / published.sigmas)[keep]
    error = ((chosen.values - truth) / chosen.sigmas)[keep]
    say("simulated and calibrated at these positions:")
    say(f"sigmas {ratio.min():.2f} to {ratio.max():.2f} times those of the 18,")
    say(f"errors {np.sqrt(np.mean(error**2)):.2f} sigma rms of {len(keep)} parameters\n")
    say("Positions after the 18 published ones that separate two effects, by a step of the angles of 15 deg")
    say(f"(none within {MOST}: -)\n")
    say(f"{'size over usual':52s}" + "".join(f"{size:>6g}" for size in SIZES))
    for pair in PAIRS:
        counts = [to_separate(pair, 15.0, size) for size in SIZES]
        say(f"{' and '.join(pair):52s}" + "".join(f"{'-' if n is None else n:>6}" for n in counts))


if __name__ == "__main__":
    main()
