"""What `new` proposes: the header with a comment at each guess, and a page with the rests that were found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import gimbalcal
from gimbalcal.errors import amount
from gimbalcal.importers.log import Proposal
from gimbalcal.recording import dwells
from gimbalcal.report import wording
from gimbalcal.report.html import picture, render
from gimbalcal.report.rounding import significant
from gimbalcal.report.style import FULL, GREY, PALE, SERIES, STYLE, empty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBERED = 60  # rests; the numbers of more would stand on each other
POINTS = 4000  # of a curve; more cannot be told apart on a page


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
        "answer": f"{amount(len(stays), 'rest')} found in {significant(float(np.ptp(r.time)), 3)} s.{advice}",
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


def _rests(found: Proposal) -> Figure:
    """Each triad over time, the rests shaded and numbered."""
    import matplotlib as mpl

    r, stays = found.recording, dwells(found.recording)
    shown = [q for q in ("specific_force", "angular_rate") if r.has(q)]
    thin = slice(None, None, max(1, len(r.time) // POINTS))
    t = r.time - r.time[0]
    with mpl.rc_context(STYLE):
        figure = empty(FULL, 0.4 + 2.2 * len(shown))
        for ax, quantity in zip(figure.subplots(len(shown), 1, sharex=True, squeeze=False).ravel(), shown, strict=True):
            for axis, color in zip(r.axes(quantity), SERIES, strict=False):
                ax.plot(t[thin], r.channels[quantity, axis][thin], lw=0.7, color=color, label=axis)
            for d in stays:
                ax.axvspan(t[d.start], t[d.stop - 1], color=PALE, lw=0, zorder=0)
                if len(stays) <= NUMBERED:
                    ax.text((t[d.start] + t[d.stop - 1]) / 2, 1.0, str(d.position), transform=ax.get_xaxis_transform(),
                            ha="center", va="bottom", fontsize=6.5, color=GREY)  # fmt: skip
            unit = "count" if r.counted(quantity) else {"specific_force": "m/s²", "angular_rate": "rad/s"}[quantity]
            ax.set_ylabel(f"{quantity.replace('_', ' ')} [{unit}]")
            ax.legend(loc="upper right", ncols=3)
        ax.set_xlabel("time [s]")
        return figure
