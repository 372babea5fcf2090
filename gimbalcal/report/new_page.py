"""What `new` proposes: the header with a comment at each guess, and a page with the rests that were found."""

from __future__ import annotations

import numpy as np

import gimbalcal
from gimbalcal.errors import amount
from gimbalcal.importers.log import Proposal
from gimbalcal.recording import dwells
from gimbalcal.report import wording
from gimbalcal.report.chart import COLOURS, Band, Chart, Line, Mark, Words, envelope, sensible_time
from gimbalcal.report.html import picture, render
from gimbalcal.report.rounding import significant

NUMBERED = 60  # rests; the numbers of more would stand on each other


def commented(header: str, found: Proposal) -> str:
    """The text of recording.toml with the reason beside each column that was guessed."""
    by_key = {(g.quantity, g.axis): (name, g) for name, g in found.guesses.items()}
    lines = [
        "# Proposed by gimbalcal new. Correct what is wrong: a unit, an axis, sign = -1; then calibrate.",
        "# The place is not known from a log: with latitude and height gravity is exact, and the Earth's rate known.",
    ]
    for line in header.splitlines():
        hit = next((found for (q, a), found in by_key.items() if f'quantity = "{q}"' in line
                    and (f'axis = "{a}"' in line if a else "axis" not in line)), None)  # fmt: skip
        lines.append(line if hit is None else f"{line}  # {hit[0].strip()}: by {hit[1].why}")
    if found.left_out:
        lines.append(f"# left out: {', '.join(name.strip() for name in found.left_out)}")
    return "\n".join(lines) + "\n"


def proposal_page(found: Proposal) -> str:
    """The page: what each column is taken for, and the forces with the rests marked."""
    r = found.recording
    stays = dwells(r)
    held = sum(float(r.time[d.stop - 1] - r.time[d.start]) for d in stays)
    rate = 1 / float(np.median(np.diff(r.time)))
    enough = len(stays) >= 9
    advice = "" if enough else " Nine or more in different attitudes are needed for all errors of three accelerometers."
    context = {
        "title": r.title,
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": f"{amount(len(stays), 'rest')} found in {significant(float(np.ptp(r.time)), 3)} s.{advice} Next: "
        "correct recording.toml where a guess below is wrong, then `gimbalcal calibrate` this folder.",
        "verdict": "fits" if enough else "reserved",
        "facts": [(f"{significant(rate, 3)} Hz", "rate"), (str(len(stays)), "rests"),
                  (f"{significant(held, 3)} s", "at rest"), (f"{len(r.time)}", "rows")],
        "picture": picture(_rests(found), f"Forces over time; {amount(len(stays), 'rest')} marked."),
        "rows": [{"name": n.strip(), "quantity": g.quantity.replace("_", " "), "axis": g.axis,
                  "unit": wording.unit_in_print(g.unit), "why": g.why} for n, g in found.guesses.items()],
        "left_out": ", ".join(name.strip() for name in found.left_out),
        "remarks": list(r.remarks),
    }  # fmt: skip
    return render("new.html", context)


def _rests(found: Proposal) -> list[Chart]:
    """Each triad over time, the rests shaded and numbered."""
    r, stays = found.recording, dwells(found.recording)
    t, unit = sensible_time(r.time - r.time[0])
    ends = [(float(t[d.start]), float(t[d.stop - 1])) for d in stays]
    charts = []
    for quantity in [q for q in ("specific_force", "angular_rate") if r.has(q)]:
        axes = r.axes(quantity)
        of = "count" if r.counted(quantity) else {"specific_force": "m/s²", "angular_rate": "rad/s"}[quantity]
        every = np.concatenate([r.channels[quantity, a] for a in axes])
        low, high = np.full(2, every.min()), np.full(2, every.max())
        marks: list[Mark] = [Band(np.array(e), low, high, "grey", "" if k else "at rest") for k, e in enumerate(ends)]
        if len(stays) <= NUMBERED and stays:
            middle = np.array([sum(e) / 2 for e in ends])
            marks.append(Words(middle, np.full(len(stays), np.inf), [str(d.position) for d in stays], "grey"))
        marks += [Line(*envelope(t, r.channels[quantity, a]), COLOURS[i % 6], a) for i, a in enumerate(axes)]
        charts.append(Chart(tuple(marks), f"{quantity.replace('_', ' ')}  [{of}]", f"time [{unit}]"))
    return charts
