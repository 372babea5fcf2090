"""Pages of plans: what a schedule of positions or turns would determine, and the schedule that was designed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.design.next_step import NextPlan
from gimbalcal.design.optimal import PositionsDesign
from gimbalcal.design.position_observability import Observability, PredictedSigma
from gimbalcal.design.turning_design import TurnsDesign
from gimbalcal.design.turning_observability import PublishedDegrees, SigmaCurve, TurningObservability
from gimbalcal.earth import HOUR
from gimbalcal.errors import number_of
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report import figures
from gimbalcal.report.chart import BLUE, Bars, Chart
from gimbalcal.report.html import Context, Picture, picture, render
from gimbalcal.schedule import Schedule
from gimbalcal.schedule.commands import RotationSchedule
from gimbalcal.units import from_si
from gimbalcal.views.positions import planned_recording
from gimbalcal.words import naming
from gimbalcal.words.answers import next_answer, plan_answer, positions_answer, turning_answer, turns_answer
from gimbalcal.words.naming import label_in_words, number_and_noun, unit_in_print
from gimbalcal.words.rounding import duration_in_words, printed_number, sensible_time, significant

CRITERIA = {"D": "volume of the remaining uncertainty", "A": "mean square of the remaining uncertainty",
            "position": "error of a day's navigation"}  # fmt: skip
NOISE_UNITS = {"arcsec": "arcsec", "ug": "µg"}
MAX_RATIO = 0.9  # of sigma to its prior, below which a parameter is reported as better known


# --- positions or a static run ----------------------------------------------------------------------------------------


def next_report(plan: NextPlan, title: str) -> str:
    """Return the page of what to record next."""
    gains = np.array([s.reduction / s.seconds * HOUR for s in plan.steps])
    chart = Chart(
        (Bars(np.arange(len(gains), dtype=float)[::-1], np.zeros(len(gains)), gains, BLUE, 0.6, lying=True),),
        "gain in an hour", "decrease of the sum of squares", y_names=[f"{k}" for k in range(len(gains), 0, -1)],
        height=24.0 * len(gains) + 60,
    )  # fmt: skip
    best = plan.steps[0] if plan.steps and not plan.reached else None
    return render("next.html", {
        "title": title, "answer": next_answer(plan), "verdict": "fits" if plan.reached else "reserved",
        "facts": [(duration_in_words(best.seconds), "for the next step")] if best else [],
        "picture": picture([chart], "Gain of each step in an hour.") if plan.steps else None,
        "targeted": plan.target is not None, "separating": bool(plan.separate),
        "steps": [
            {"words": s.words, "time": duration_in_words(s.seconds),
            "parameter": naming.without_underscores(s.parameter),
             "now": significant(s.sigma_now, 3), "after": significant(s.sigma_after, 3), "unit": unit_in_print(s.unit),
             "gain": f"{100 * s.reduction:.3g} %", "separation": significant(s.separation or 0.0, 3)}
            for s in plan.steps
        ],
        "rows": [
            {"group": p.name, "words": naming.name_in_words(p.name, p.axis),
             "sigma": significant(float(from_si(s, p.unit)), 3), "unit": unit_in_print(p.unit),
             "target": "" if plan.target is None else significant(float(from_si(plan.target[i], p.unit)), 3),
             "prior": significant(float(from_si(p.sigma, p.unit)), 2)}
            for i, (p, s) in enumerate(zip(plan.parameters, plan.sigma, strict=True))
        ],
    })  # fmt: skip


def schedule_report(o: Observability | TurningObservability) -> str:
    """Return the page of the observability of a schedule of positions or of turns, or of a static run."""
    return plan_report(o) if isinstance(o, Observability) else observability_report(o)


def plan_report(o: Observability) -> str:
    """Return the page of the observability of a schedule of positions or a static run."""
    total, unseen = len(o.rows), o.unobservable
    noise = ((key.rpartition("_"), v) for key, v in o.noise.items())
    known = ((v, NOISE_UNITS[unit], sensor) for (sensor, _, unit), v in noise if unit in NOISE_UNITS)
    facts = [
        (f"{significant(v, 3)} {unit}", f"noise: {naming.without_underscores(sensor)}") for v, unit, sensor in known
    ]
    hidden = [c.effect for c in o.candidates if c.strength < MIN_SIGNAL_TO_NOISE]
    return render("plan.html", {
        "kind": "Observability of a schedule", "title": naming.typeset(o.schedule), "answer": plan_answer(o),
        "verdict": "reserved" if unseen else "fits",
        "facts": [(f"{total - len(unseen)} of {total}", "combinations determined"), *facts],
        "picture": _sigmas(o.rows), "side_by_side": True,
        "unobservable": naming.directions_in_words(unseen),
        "remarks": [f"At its usual size {naming.name_in_words(effect)} would not be detected." for effect in hidden],
        "rows": _rows(o.rows, ()), "others": (),
        "confounded": [{"one": label_in_words(c.one), "other": label_in_words(c.other),
                        "cosine": printed_number(f"{c.cosine:+.4f}")} for c in o.confounded],
        "candidates": [{"words": naming.name_in_words(c.effect), "strength": significant(c.strength, 3),
                        "absorbed": f"{100 * c.absorbed:.0f} %"} for c in o.candidates],
    })  # fmt: skip


def _rows(rows: Sequence[PredictedSigma], others: Sequence[str]) -> list[Context]:
    return [
        {
            "words": naming.name_in_words(r.parameter.name, r.parameter.axis),
            "group": r.parameter.name,
            "sigma": significant(r.sigma, 3),
            "unit": unit_in_print(r.parameter.unit),
            "prior": significant(r.prior_sigma, 2),
            "better": _improvement_in_words(r.sigma / r.prior_sigma),
            "others": [significant(r.others[n], 3) for n in others],
        }
        for r in rows
    ]


def _improvement_in_words(ratio: float) -> str:
    return "not better" if ratio >= MAX_RATIO or ratio <= 0 else f"{significant(1 / ratio, 3)} times"


def _sigmas(rows: Sequence[PredictedSigma]) -> Picture:
    """Draw sigma relative to its prior, of each parameter."""
    ratio = np.array([r.sigma / r.prior_sigma for r in rows])
    return picture(
        figures.dots_by_name([naming.name_in_words(r.parameter.name, r.parameter.axis) for r in rows], {"": ratio},
                             "σ / usual size (left: better known)", "of its usual size", [figures.AS_BEFORE]),
        f"Uncertainty of {number_and_noun(len(rows), 'parameter')} after the schedule, relative to the usual size.",
        "Uncertainty of each parameter after the schedule; at the dashed line it is as large as before.",
    )  # fmt: skip


# --- a design ---------------------------------------------------------------------------------------------------------


def design_report(d: PositionsDesign | TurnsDesign) -> str:
    """Return the page of a designed schedule, of positions or of turns."""
    return render("plan.html", {
        "kind": "Designed schedule", "answer": design_headline(d),
        "verdict": "reserved" if isinstance(d, PositionsDesign) and d.unobservable else "fits",
        "side_by_side": False, "confounded": [], "candidates": [],
        **(_positions(d) if isinstance(d, PositionsDesign) else _turns(d)),
    })  # fmt: skip


def design_headline(d: PositionsDesign | TurnsDesign) -> str:
    """Return the answer of a design, of positions or of turns."""
    return positions_answer(d) if isinstance(d, PositionsDesign) else turns_answer(d)


def _positions(d: PositionsDesign) -> Context:
    names = list(d.against)
    return {
        "title": d.schedule.name, "picture": _schedule_picture(d.schedule),
        "unobservable": naming.directions_in_words(d.unobservable),
        "facts": [(str(len(d.schedule.holds)), "positions"), (d.angles, "uncertainty of the angles"),
                  (CRITERIA[d.criterion], "minimised")],
        "remarks": [naming.as_sentences(text) for text in d.remarks], "rows": _rows(d.rows, names), "others": names,
    }  # fmt: skip


def _turns(d: TurnsDesign) -> Context:
    turns = str(len(d.schedule.moves))
    rows = [{"group": g.group, "words": naming.name_in_words(g.group), "sigma": significant(g.sigma, 3), "prior": "",
             "unit": unit_in_print(g.unit), "better": _improvement_in_words(g.ratio),
             "others": [significant(v, 3) for v in g.against.values()]} for g in d.groups]  # fmt: skip
    return {
        "title": f"{turns} turns", "picture": _drawn_turns(d.schedule), "unobservable": [],
        "facts": [
            (turns, "turns"), (duration_in_words(d.duration), "in total"),
            (duration_in_words(d.schedule.stop), "each stop"),
        ],
        "remarks": [], "rows": rows, "others": list(d.groups[0].against) if d.groups else [],
    }  # fmt: skip


def _schedule_picture(schedule: Schedule) -> Picture:
    """Draw the gimbal angles, and the direction of gravity in platform axes, at each position."""
    angles = np.rad2deg(np.array([h.angles for h in schedule.holds]))
    labels = [str(k) for k in range(1, len(angles) + 1)]
    force = stimulus_from_angles(planned_recording(schedule)).force
    gravity = -force / np.linalg.norm(force, axis=1, keepdims=True)
    return picture(
        figures.schedule(labels, angles, schedule.platform.axis_names, gravity),
        f"Gimbal angles at {number_and_noun(len(labels), 'position')}, and the direction of gravity in platform axes.",
        "Motion of the platform: gimbal angles by position, and the direction of gravity in its axes, along z.",
    )


def _drawn_turns(schedule: RotationSchedule) -> Picture:
    """Draw the angle about each axis of the table, and the direction of gravity in the unit, at each stop."""
    axes = list(dict.fromkeys(m.axis for m in schedule.moves))
    each = np.array([[m.angle * (m.axis == a) for a in axes] for m in schedule.moves])
    angles = np.rad2deg(np.concatenate([np.zeros((1, len(axes))), np.cumsum(each, axis=0)]))
    down = schedule.attitudes().transpose(0, 2, 1) @ np.array([0.0, 0.0, 1.0])
    labels = [str(k) for k in range(len(angles))]
    return picture(
        figures.schedule(labels, angles, axes, down, "unit", "stop"),
        f"Angles of the axes through {number_and_noun(len(schedule.moves), 'turn')}, and the direction of gravity in "
        "the unit.",
        "Motion of the table: its angle about each axis at each stop, and the direction of gravity in "
        "the unit, along z.",
    )


# --- a schedule of turns ----------------------------------------------------------------------------------------------


def observability_report(o: TurningObservability) -> str:
    """Return the page of the observability of a schedule of turns."""
    worst = min(o.curves, key=lambda c: c.degree)
    unseen, last, noise = naming.directions_in_words(o.bounds.unobservable), float(o.time[-1]), o.bounds.noise
    return render("observability.html", {
        "title": o.bounds.schedule,
        "answer": turning_answer(o),
        "verdict": "fits" if not unseen and all(c.word == "high" for c in o.curves) else "reserved",
        "facts": [
            (duration_in_words(last), "duration of all turns and stops"),
            (f"{significant(worst.degree, 3)} times",
             f"improvement of the least known error, {label_in_words(worst.parameter)}"),
            (f"{noise['gyroscope_deg_per_sqrt_h']:g} °/√h", "noise of the gyroscopes"),
            (f"{noise['accelerometer_ug_per_sqrt_Hz']:g} µg/√Hz", "noise of the accelerometers"),
        ],
        "curves": picture(
            _curves(o),
            f"Sigma of {number_of(len(o.curves), 'state')} over {duration_in_words(last)}, on a logarithmic "
            "scale.",
            "One sigma of each state against time, starting at its usual size; each step down is a turn.",
        ),
        "unobservable": unseen,
        "weak": [{"direction": naming.direction_in_words(direction),
                  "why": f"known {significant(degree, 3)} times better than before"} for direction, degree in o.weak],
        "rows": [_state_row(c) for c in (*o.curves, *o.navigation)],
        "published": _published_comparison(o.published),
        "citations": cite("wei2022", "yan2018", "friedland1969"),
    })  # fmt: skip


def _state_row(c: SigmaCurve) -> dict[str, str]:
    return {"words": label_in_words(c.parameter), "sigma": significant(float(c.printed[-1]), 3),
            "unit": unit_in_print(c.unit), "degree": significant(c.degree, 3), "word": c.word}  # fmt: skip


def _published_comparison(table: PublishedDegrees | None) -> Context:
    """Return the comparison with published degrees; empty without one."""
    if table is None:
        return {}
    rows = [{"words": label_in_words(r.parameter), "printed": f"{r.printed:.2f}", "degree": significant(r.degree, 3),
             "ratio": significant(r.ratio, 2)} for r in table.rows]  # fmt: skip
    return {"rows": rows, "in_words": naming.as_sentence(table.in_words)}


def _curves(o: TurningObservability) -> list[Chart]:
    """Draw a chart for each name and unit, with a line for each axis."""
    groups: dict[tuple[str, str], list[tuple[str, Array]]] = {}
    for c in o.curves:
        name, _, axis = c.parameter.partition(":")
        groups.setdefault((name, c.unit), []).append((axis, c.printed))
    time, unit = sensible_time(o.time)
    curves = [(f"{label_in_words(name)}  [{unit_in_print(of)}]", lines) for (name, of), lines in groups.items()]
    return figures.curves_by_group(time, curves, f"time [{unit}]")
