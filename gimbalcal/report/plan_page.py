"""Pages of plans: what a schedule of positions or turns would see, and the schedule that was designed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.errors import amount
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report import figures
from gimbalcal.report.chart import Chart, lasting, sensible_time
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.schedule import Schedule
from gimbalcal.schedule.rotation import RotationSchedule
from gimbalcal.words import naming
from gimbalcal.words.naming import counted, label_in_words, label_of, precision, unit_in_print
from gimbalcal.words.rounding import minus, significant

CRITERIA = {"D": "volume of the remaining uncertainty", "A": "mean square of the remaining uncertainty",
            "position": "error of a day's navigation"}  # fmt: skip
MAX_RATIO = 0.9  # of sigma to its prior, below which a parameter is reported as better known


def plan_report(content: Mapping[str, Any]) -> str:
    """Return the page for the observability.json of a schedule of positions or a static run."""
    rows, unseen = content["parameters"], content["unobservable"]
    noise = content["noise"]
    facts = [(f"{significant(float(v), 3)} {_unit(k)}", f"noise: {k.rpartition('_')[0].replace('_', ' ')}")
             for k, v in noise.items() if isinstance(v, (int, float)) and _unit(k)]  # fmt: skip
    hidden = [c for c in content["candidates"] if c["strength"] < 1]
    remarks = [f"At its usual size {naming.named(c['effect'])} would not be detected." for c in hidden]
    return render("plan.html", {
        **_shared("Observability of a schedule", naming.typeset(content["schedule"]), headline(content), bool(unseen)),
        "facts": [(f"{len(rows) - len(unseen)} of {len(rows)}", "combinations determined"), *facts],
        "picture": _sigmas(rows),
        "side_by_side": True,
        "unobservable": naming.directions(unseen),
        "remarks": remarks,
        "rows": _rows(rows, ()),
        "others": (),
        "confounded": [{"one": label_in_words(c["one"]), "other": label_in_words(c["other"]),
                        "cosine": minus(f"{c['cosine']:+.4f}")} for c in content["twins"]],
        "candidates": [{"words": naming.named(c["effect"]), "strength": significant(c["strength"], 3),
                        "absorbed": f"{100 * c['absorbed']:.0f} %"} for c in content["candidates"]],
    })  # fmt: skip


def headline(content: Mapping[str, Any]) -> str:
    """Return which parameters positions or a static run determine, how well, and what to do next."""
    rows, unseen = content["parameters"], content["unobservable"]
    text = f"{content['schedule']} determines {_share(len(rows) - len(unseen), len(rows))} of the parameters."
    text = naming.as_sentence(text) + _precision(rows, unseen)
    if unseen:
        text += (
            f" {naming.capitalised(counted(len(unseen), 'combination'))} cannot be observed, and a longer recording "
        )
        text += "does not help; another attitude or another instrument does."
    return text


def design_headline(plan: Mapping[str, Any]) -> str:
    """Return which parameters a designed schedule determines, how well, compared with which, and what to do next."""
    first, *others = plan["in_words"].split("\n")
    if "groups" in plan:
        turns, stop, whole = counted(plan["turns"], "turn"), plan["stop_s"], lasting(plan["total_s"])
        text = f"{naming.capitalised(turns)} with stops of {stop:.3g} s take {whole}." + precision(
            (g["group"], g["sigma"], g["unit"]) for g in plan["groups"]
        )
        compared = others[len(plan["groups"]) :]
    else:
        rows, unseen = plan["parameters"], plan["unobservable"]
        share = _share(len(rows) - len(unseen), len(rows))
        text = naming.sentence(f"{first}, determine {share} of the parameters") + _precision(rows, unseen)
        position = plan["criterion"] == "position"
        ratios = {name: a["criterion_ratio_equal_time" if position else "sigma_ratio_equal_time"]
                  for name, a in plan["against"].items()}  # fmt: skip
        what, which = ("that error", "") if position else ("σ", ", on average")
        text += f" {naming.sentence(others[0])}" if position else ""
        compared = [f"In the time that {n} takes, {what} is {x:.2f} times that of {n}{which}"
                    for n, x in ratios.items()]  # fmt: skip

    return " ".join([text, *map(naming.answered, compared), "Next: turn the rig through schedule.toml while it logs."])


def _precision(rows: Sequence[Mapping[str, Any]], unseen: Sequence[Mapping[str, Any]]) -> str:
    lost = naming.unobservable_leading(unseen)
    return precision((p["name"], p["sigma"], p["unit"]) for p in rows if label_of(p) not in lost)


def design_report(plan: Mapping[str, Any], schedule: Schedule | RotationSchedule) -> str:
    """Return the page of a designed schedule, of positions or of turns."""
    _, *others = plan["in_words"].split("\n")
    if isinstance(schedule, RotationSchedule):
        rows = [{"words": naming.named(g["group"]), "sigma": significant(g["sigma"], 3), "first": True, "prior": "",
                 "unit": unit_in_print(g["unit"]), "better": _better(g["ratio"]),
                 "others": [significant(v, 3) for v in g["against"].values()]} for g in plan["groups"]]  # fmt: skip
        title, names = f"{len(schedule.moves)} turns", list(plan["groups"][0]["against"]) if plan["groups"] else []
        facts = [(str(plan["turns"]), "turns"), (lasting(plan["total_s"]), "in total"),
                 (lasting(plan["stop_s"]), "each stop")]  # fmt: skip
        drawn, unseen, others = _turns(schedule), [], []
    else:
        title, names = schedule.name, list(plan["against"])
        rows, unseen = _rows(plan["parameters"], names), plan["unobservable"]
        facts = [
            (str(plan["positions"]), "positions"),
            (plan["angles"], "uncertainty of the angles"),
            (CRITERIA.get(plan["criterion"], plan["criterion"]), "minimised"),
        ]
        drawn = _drawn(schedule)
        others = [o for o in others if not o.startswith("not seen")]
    return render("plan.html", {
        **_shared("Designed schedule", title, design_headline(plan), bool(unseen)),
        "facts": facts, "picture": drawn, "side_by_side": False, "unobservable": naming.directions(unseen),
        "remarks": [naming.answered(o) for o in others],
        "rows": rows, "others": names, "confounded": [], "candidates": [],
    })  # fmt: skip


def _shared(kind: str, title: str, answer: str, doubtful: bool) -> dict[str, Any]:
    return {"kind": kind, "title": title, "answer": answer,
            "verdict": "reserved" if doubtful else "fits"}  # fmt: skip


def _share(determined: int, every: int) -> str:
    return f"all {counted(every, 'combination')}" if determined == every else f"{determined} of {every} combinations"


def _unit(key: str) -> str:
    return {"arcsec": "arcsec", "ug": "µg"}.get(key.rpartition("_")[2], "")


def _rows(parameters: Sequence[Mapping[str, Any]], others: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {
            "words": naming.named(p["name"], p["axis"]),
            "first": not i or p["name"] != parameters[i - 1]["name"],
            "sigma": significant(p["sigma"], 3),
            "unit": unit_in_print(p["unit"]),
            "prior": significant(p["prior_sigma"], 2),
            "better": _better(p["sigma"] / p["prior_sigma"]),
            "others": [significant(p["others"][n], 3) for n in others],
        }
        for i, p in enumerate(parameters)
    ]


def _better(ratio: float) -> str:
    return "not better" if ratio >= MAX_RATIO or ratio <= 0 else f"{significant(1 / ratio, 3)} times"


def _sigmas(rows: Sequence[Mapping[str, Any]]) -> Picture:
    """Draw sigma relative to its prior, of each parameter."""
    ratio = np.array([p["sigma"] / p["prior_sigma"] for p in rows])
    return picture(
        figures.dots_by_name([naming.named(p["name"], p["axis"]) for p in rows], {"": ratio},
                             "σ / usual size (left: better known)", "of its usual size", [figures.AS_BEFORE]),
        f"Uncertainty of {counted(len(rows), 'parameter')} after the schedule, relative to the usual size.",
        "Uncertainty of each parameter after the schedule; at the dashed line it is as large as before.",
    )  # fmt: skip


def _drawn(schedule: Schedule) -> Picture:
    angles = np.rad2deg(np.array([h.angles for h in schedule.holds]))
    labels = [str(k) for k in range(1, len(angles) + 1)]
    charts = figures.schedule(labels, angles, schedule.platform.axis_names, _gravity(schedule))
    return picture(
        charts,
        f"Gimbal angles at {counted(len(labels), 'position')}, and the direction of gravity in platform axes.",
        "Motion of the platform: gimbal angles by position, and the direction of gravity in its axes, along z.",
    )


def _turns(schedule: RotationSchedule) -> Picture:
    """Draw the angle about each axis of the table, and the direction of gravity in the unit, at each stop."""
    axes = list(dict.fromkeys(m.axis for m in schedule.moves))
    each = np.array([[m.angle * (m.axis == a) for a in axes] for m in schedule.moves])
    angles = np.rad2deg(np.concatenate([np.zeros((1, len(axes))), np.cumsum(each, axis=0)]))
    down = schedule.attitudes().transpose(0, 2, 1) @ np.array([0.0, 0.0, 1.0])
    labels = [str(k) for k in range(len(angles))]
    return picture(
        figures.schedule(labels, angles, axes, down, "unit", "stop"),
        f"Angles of the axes through {counted(len(schedule.moves), 'turn')}, and the direction of gravity in the unit.",
        "Motion of the table: its angle about each axis at each stop, and the direction of gravity in "
        "the unit, along z.",
    )


def _gravity(schedule: Schedule) -> np.ndarray[Any, Any]:
    from gimbalcal.estimate.accelerometers.expected import planned
    from gimbalcal.kinematics import stimulus_from_angles

    force = stimulus_from_angles(planned(schedule)).force
    return np.asarray(-force / np.linalg.norm(force, axis=1, keepdims=True))


# --- a schedule of turns ----------------------------------------------------------------------------------------------

MAX_STATES = 4  # that a headline names


def observability_report(content: Mapping[str, Any]) -> str:
    """Return the page for the content of the observability.json of a schedule of turns."""
    errors = _errors(content)
    worst = min(errors, key=lambda s: float(s["degree"]))
    high = sum(s["observability"] == "high" for s in errors)
    unseen = naming.directions(content["unobservable"])
    last = float(errors[0]["time_s"][-1])
    noise = content["noise"]
    return render("observability.html", {
        "title": content["schedule"],
        "answer": turning_headline(content),
        "verdict": "fits" if not unseen and high == len(errors) else "reserved",
        "facts": [
            (lasting(last), "duration of all turns and stops"),
            (f"{significant(float(worst['degree']), 3)} times",
             f"improvement of the least known error, {label_in_words(worst['parameter'])}"),
            (f"{noise['gyroscope_deg_per_sqrt_h']:g} °/√h", "noise of the gyroscopes"),
            (f"{noise['accelerometer_ug_per_sqrt_Hz']:g} µg/√Hz", "noise of the accelerometers"),
        ],
        "curves": picture(
            _curves(errors),
            f"Sigma of {amount(len(errors), 'state')} over {lasting(last)}, on a logarithmic scale.",
            "One sigma of each state against time, starting at its usual size; each step down is a turn.",
        ),
        "unobservable": unseen,
        "weak": [{"direction": naming.direction_in_words(w["direction"]),
                  "why": f"known {significant(float(w['degree']), 3)} times better than before"}
                 for w in content["weak"]],
        "rows": [_row(s) for s in content["states"]],
        "published": _published(content["published"]),
        "citations": cite("wei2022", "yan2018", "friedland1969"),
    })  # fmt: skip


def turning_headline(content: Mapping[str, Any]) -> str:
    """Return which errors a schedule of turns determines, how well, and what to do next."""
    errors = _errors(content)
    lost, unseen = naming.unobservable_leading(content["unobservable"]), len(content["unobservable"])
    low = [s for s in errors if s["observability"] != "high" and s["parameter"] not in lost]
    share = (
        f"{len(errors) - unseen} of {len(errors)} combinations" if unseen else f"all {counted(len(errors), 'error')}"
    )
    text = f"{content['schedule']} determines {share} of the unit in {lasting(float(errors[0]['time_s'][-1]))}."
    text += precision((s["parameter"].partition(":")[0], float(s["sigma"][-1]), s["unit"])
                      for s in errors if s["parameter"] not in lost)  # fmt: skip
    if unseen:
        text += (
            f" {naming.capitalised(counted(unseen, 'combination'))} cannot be observed: turn about another axis, too."
        )
    if low:
        text += (
            f" Hardly better known than before: {', '.join(label_in_words(s['parameter']) for s in low[:MAX_STATES])}"
        )
        text += f" and {len(low) - MAX_STATES} more." if len(low) > MAX_STATES else "."
    return text if unseen or low else f"{text} Next: record it, then `gimbalcal calibrate` the recording."


def _errors(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the states that are errors of the unit, not of its attitude, velocity or position."""
    return [s for s in content["states"] if not s["parameter"].startswith(("attitude:", "velocity:", "place:"))]


def _row(state: Mapping[str, Any]) -> dict[str, str]:
    return {
        "words": label_in_words(state["parameter"]),
        "sigma": significant(float(state["sigma"][-1]), 3),
        "unit": unit_in_print(state["unit"]),
        "degree": significant(float(state["degree"]), 3),
        "word": state["observability"],
    }


def _published(table: Mapping[str, Any]) -> dict[str, Any]:
    if not table:
        return {}
    rows = [
        {
            "words": label_in_words(r["parameter"]),
            "printed": f"{r['printed']:.2f}",
            "degree": significant(float(r["degree"]), 3),
            "ratio": significant(float(r["ratio"]), 2),
        }
        for r in table["rows"]
    ]
    return {"rows": rows, "in_words": naming.as_sentence(table["in_words"])}


def _curves(states: Sequence[Mapping[str, Any]]) -> list[Chart]:
    """Draw a chart for each name and unit, with a line for each axis."""
    groups: dict[tuple[str, str], list[tuple[str, Array]]] = {}
    for s in states:
        name, _, axis = s["parameter"].partition(":")
        groups.setdefault((name, s["unit"]), []).append((axis, np.asarray(s["sigma"])))
    time, unit = sensible_time(np.asarray(states[0]["time_s"]))
    curves = [(f"{label_in_words(name)}  [{unit_in_print(of)}]", lines) for (name, of), lines in groups.items()]
    return figures.curves_by_group(time, curves, f"time [{unit}]")
