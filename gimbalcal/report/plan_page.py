"""The page of a plan: what a schedule of positions or a static run would see, and the schedule that was designed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.report import wording
from gimbalcal.report.chart import Chart, Points, Rule, lasting
from gimbalcal.report.figures import schedule as schedule_charts
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.reach import reach
from gimbalcal.report.rounding import minus, significant
from gimbalcal.schedule import Schedule
from gimbalcal.schedule.rotation import RotationSchedule

CRITERIA = {"D": "volume of what stays uncertain", "A": "mean square of what stays uncertain",
            "position": "error of a day's navigation"}  # fmt: skip
LEAST = 0.9  # of what is known before: less is no news


def plan_report(content: Mapping[str, Any]) -> str:
    """The page for the observability.json of a schedule of positions or a static run."""
    rows, unseen = content["parameters"], content["unobservable"]
    noise = content["noise"]
    facts = [(f"{significant(float(v), 3)} {_unit(k)}", f"noise: {k.rpartition('_')[0].replace('_', ' ')}")
             for k, v in noise.items() if isinstance(v, (int, float)) and _unit(k)]  # fmt: skip
    hidden = [c for c in content["candidates"] if c["strength"] < 1]
    remarks = [f"At its usual size {wording.named(c['effect'])} would not show." for c in hidden]
    return render("plan.html", {
        **_shared("What a schedule sees", wording.typeset(content["schedule"]), headline(content), bool(unseen)),
        "facts": [(f"{len(rows) - len(unseen)} of {len(rows)}", "combinations seen"), *facts],
        "picture": _sigmas(rows),
        "beside": True,
        "unobservable": _unobservable(unseen),
        "remarks": remarks,
        "rows": _rows(rows, ()),
        "others": (),
        "confounded": [{"one": wording.label_in_words(c["one"]), "other": wording.label_in_words(c["other"]),
                        "cosine": minus(f"{c['cosine']:+.4f}")} for c in content["twins"]],
        "candidates": [{"words": wording.named(c["effect"]), "strength": significant(c["strength"], 3),
                        "absorbed": f"{100 * c['absorbed']:.0f} %"} for c in content["candidates"]],
    })  # fmt: skip


def headline(content: Mapping[str, Any]) -> str:
    """What the observability.json of positions or a static run comes to: what it tells, how well, what next."""
    rows, unseen = content["parameters"], content["unobservable"]
    text = f"{content['schedule']} tells {_share(len(rows) - len(unseen), len(rows))} of what is to be calibrated."
    text = wording.sentence(wording.typeset(text)) + _reach(rows, unseen)
    if unseen:
        text += f" {wording.counted(len(unseen), 'combination').capitalize()} cannot be seen, and no longer recording "
        text += "helps: another attitude or another instrument does."
    return text


def design_headline(seen: Mapping[str, Any]) -> str:
    """What a designed schedule comes to: what it tells, how well, beside which, what next."""
    first, *others = seen["in_words"].split("\n")
    if "groups" in seen:
        turns, stop, whole = wording.counted(seen["turns"], "turn"), seen["stop_s"], lasting(seen["total_s"])
        text = f"{turns.capitalize()} with stops of {stop:.3g} s take {whole}." + reach(
            (g["group"], g["sigma"], g["unit"]) for g in seen["groups"]
        )
        beside = others[len(seen["groups"]) :]
    else:
        rows, unseen = seen["parameters"], seen["unobservable"]
        told = f"{first}, tell {_share(len(rows) - len(unseen), len(rows))} of what is to be calibrated"
        text = wording.sentence(told) + _reach(rows, unseen)
        position = seen["criterion"] == "position"
        ratios = {name: a["criterion_ratio_equal_time" if position else "sigma_ratio_equal_time"]
                  for name, a in seen["against"].items()}  # fmt: skip
        what, which = ("that error", "") if position else ("σ", ", in the mean")
        text += f" {wording.sentence(others[0])}" if position else ""
        beside = [f"In the time that {n} takes, {what} is {x:.2f} times what {n} leaves{which}"
                  for n, x in ratios.items()]  # fmt: skip

    return " ".join([text, *map(wording.answered, beside), "Next: turn the rig through schedule.toml while it logs."])


def _reach(rows: Sequence[Mapping[str, Any]], unseen: Sequence[Mapping[str, Any]]) -> str:
    lost = wording.unobservable_leading(unseen)
    return reach((p["name"], p["sigma"], p["unit"]) for p in rows if wording.label_of(p) not in lost)


def design_report(seen: Mapping[str, Any], made: Schedule | RotationSchedule) -> str:
    """The page of a designed schedule, of positions or of turns."""
    _, *others = seen["in_words"].split("\n")
    if isinstance(made, RotationSchedule):
        rows = [{"words": wording.named(g["group"]), "sigma": significant(g["sigma"], 3), "first": True, "prior": "",
                 "unit": wording.unit_in_print(g["unit"]), "better": _better(g["ratio"]),
                 "others": [significant(v, 3) for v in g["against"].values()]} for g in seen["groups"]]  # fmt: skip
        title, names = f"{len(made.moves)} turns", list(seen["groups"][0]["against"]) if seen["groups"] else []
        facts = [(str(seen["turns"]), "turns"), (lasting(seen["total_s"]), "altogether"),
                 (lasting(seen["stop_s"]), "each stop")]  # fmt: skip
        drawn, unseen, others = _turns(made), [], []
    else:
        title, names = made.name, list(seen["against"])
        rows, unseen = _rows(seen["parameters"], names), seen["unobservable"]
        facts = [
            (str(seen["positions"]), "positions"),
            (seen["angles"], "angles known to"),
            (CRITERIA.get(seen["criterion"], seen["criterion"]), "made smallest"),
        ]
        drawn = _drawn(made)
        others = [o for o in others if not o.startswith("not seen")]
    return render("plan.html", {
        **_shared("Designed schedule", title, design_headline(seen), bool(unseen)),
        "facts": facts, "picture": drawn, "beside": False, "unobservable": _unobservable(unseen),
        "remarks": [wording.answered(o) for o in others],
        "rows": rows, "others": names, "confounded": [], "candidates": [],
    })  # fmt: skip


def _shared(kind: str, title: str, answer: str, doubtful: bool) -> dict[str, Any]:
    return {"kind": kind, "title": title, "answer": answer,
            "verdict": "reserved" if doubtful else "fits"}  # fmt: skip


def _share(seen: int, every: int) -> str:
    return f"all {wording.counted(every, 'combination')}" if seen == every else f"{seen} of {every} combinations"


def _unit(key: str) -> str:
    return {"arcsec": "arcsec", "ug": "µg"}.get(key.rpartition("_")[2], "")


def _unobservable(unseen: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    return [{"direction": wording.direction_in_words(u["direction"]), "why": wording.why_in_words(u)} for u in unseen]


def _rows(parameters: Sequence[Mapping[str, Any]], others: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {
            "words": wording.named(p["name"], p["axis"].replace("_", " ")),
            "first": not i or p["name"] != parameters[i - 1]["name"],
            "sigma": significant(p["sigma"], 3),
            "unit": wording.unit_in_print(p["unit"]),
            "prior": significant(p["prior_sigma"], 2),
            "better": "not better"
            if p["sigma"] >= LEAST * p["prior_sigma"]
            else f"{significant(p['prior_sigma'] / p['sigma'], 3)} times",
            "others": [significant(p["others"][n], 3) for n in others],
        }
        for i, p in enumerate(parameters)
    ]


def _better(ratio: float) -> str:
    return "not better" if ratio >= LEAST or ratio <= 0 else f"{significant(1 / ratio, 3)} times"


def _sigmas(rows: Sequence[Mapping[str, Any]]) -> Picture:
    """What the schedule leaves of each prior sigma."""
    words = [wording.named(p["name"], p["axis"].replace("_", " ")) for p in rows][::-1]
    ratio = np.array([p["sigma"] / p["prior_sigma"] for p in rows])[::-1]
    told = [f"{w}: {r:.2g} of what is known before" for w, r in zip(words, ratio, strict=True)]
    chart = Chart(
        (Rule(1.0, "grey", upright=True, dashed=True),
         Points(ratio, np.arange(len(words), dtype=float), size=3.6, names=told)),
        x_label="σ / usual size (left: better known)", y_names=words, log_x=True, height=14.0 * len(words) + 14,
    )  # fmt: skip
    return picture(chart, f"What the schedule leaves of the uncertainty of {wording.counted(len(rows), 'parameter')}.",
                   "What is left of each parameter’s uncertainty; at the dashed line nothing was learned.")  # fmt: skip


def _drawn(made: Schedule) -> Picture:
    angles = np.rad2deg(np.array([h.angles for h in made.holds]))
    labels = [str(k) for k in range(1, len(angles) + 1)]
    charts = schedule_charts(labels, angles, made.platform.axis_names, _gravity(made))
    return picture(
        charts,
        f"Gimbal angles at {wording.counted(len(labels), 'position')}, and where gravity lies in platform axes.",
        "What the platform is to do: gimbal angles by position, and the direction of gravity in its axes, along z.",
    )


def _turns(made: RotationSchedule) -> Picture:
    """How far the unit is turned about each axis of the table, and where gravity lies in it at each stop."""
    axes = list(dict.fromkeys(m.axis for m in made.moves))
    each = np.array([[m.angle * (m.axis == a) for a in axes] for m in made.moves])
    angles = np.rad2deg(np.concatenate([np.zeros((1, len(axes))), np.cumsum(each, axis=0)]))
    down = made.attitudes().transpose(0, 2, 1) @ np.array([0.0, 0.0, 1.0])
    labels = [str(k) for k in range(len(angles))]
    return picture(
        schedule_charts(labels, angles, axes, down, "unit", "stop"),
        f"Angles of the axes through {wording.counted(len(made.moves), 'turn')}, and where gravity lies in the unit.",
        "What the table is to do: how far it has turned about each axis at each stop, and the direction of gravity in "
        "the unit, along z.",
    )


def _gravity(made: Schedule) -> np.ndarray[Any, Any]:
    from gimbalcal.estimate.accelerometers.expected import planned
    from gimbalcal.kinematics import stimulus_from_angles

    force = stimulus_from_angles(planned(made)).force
    return np.asarray(-force / np.linalg.norm(force, axis=1, keepdims=True))
