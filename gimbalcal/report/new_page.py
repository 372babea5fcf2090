"""The proposal of `new`: the header with a comment at each guess, and a page with the dwells that were detected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.errors import number_of
from gimbalcal.guess.proposal import Proposal
from gimbalcal.recording import Dwell, Recording, dwells
from gimbalcal.recording.dwell import UP_AND_DOWN, in_several_attitudes
from gimbalcal.report.chart import COLOURS, Band, Chart, Line, Mark, Points, Words, envelope
from gimbalcal.report.html import picture, render
from gimbalcal.units import from_si
from gimbalcal.words import naming
from gimbalcal.words.rounding import duration_in_words, sensible_time, significant

# lines of the header before which notes on the whole recording are written
HEADED = {"kind": ("kind", "signs", "order", "hours", "sky", "sign", "unit", "further"), "samples": ("samples",),
          "[site]": ("site",), "[platform]": ("platform",), "[noise]": ("noise", "sigma")}  # fmt: skip
NEXT = "Next: correct recording.toml where a guess below is wrong, then `gimbalcal calibrate` this folder."
MAX_NUMBERS = 60  # of dwells; more would overlap


def commented_header(header: str, proposal: Proposal) -> str:
    """Return recording.toml with a comment on each column that was guessed, and notes on the whole recording."""
    by_key = {(g.quantity, g.axis): (name, g) for name, g in proposal.guesses.items()}
    lines = [
        "# Proposed by gimbalcal new. Correct what is wrong: a unit, an axis, sign = -1; then calibrate.",
        *([] if proposal.recording.site.latitude is not None or proposal.recording.kind.sighting else [
            "# A log does not state its site: --latitude and --height, or both in [site], give gravity to 100 ppm",
            '# and the rate of the Earth: latitude = { value = 48.1, unit = "deg" }',
        ]),
    ]  # fmt: skip
    for line in header.splitlines():
        keys = HEADED.get(line.partition(" =")[0], ())
        lines += [f"# {proposal.notes[key]}" for key in keys if key in proposal.notes]
        hit = next((named for (q, a), named in by_key.items() if f'quantity = "{q}"' in line
                    and (f'axis = "{a}"' in line if a else "axis" not in line)), None)  # fmt: skip
        lines.append(line if hit is None else f"{line}  # {hit[0].strip()}: by {hit[1].why}")
    if proposal.left_out:
        lines.append(f"# not used: {', '.join(name.strip() for name in proposal.left_out)}")
    return "\n".join(lines) + "\n"


def proposal_page(proposal: Proposal) -> str:
    """Return the page: the interpretation of each column, and the forces with dwells marked or the offsets of stars."""
    r = proposal.recording
    stars, intervals = r.kind.sighting, () if (r.kind.sighting or r.kind.rotating) else dwells(r)
    enough = r.kind.rotating or (len(r.time) if stars else len(intervals)) >= 9
    notes = [f"{what}: {note}" for what, note in proposal.notes.items()]
    shown = f"Forces over time; {number_of(len(intervals), 'rest')} marked." if intervals else "Rates over time."
    shown = "Offset of the readouts of each axis, before any model." if stars else shown
    context = {
        "title": r.title,
        "answer": f"{number_of(len(r.time), 'star')} found. {NEXT}" if stars else _answer(proposal, len(intervals)),
        "verdict": "fits" if enough else "reserved",
        "facts": [(str(len(r.time)), "stars")] if stars else _facts(proposal, intervals),
        "picture": picture(_offsets(r) if stars else _force_charts(proposal, intervals), shown),
        "rows": [{"name": n.strip(), "quantity": g.quantity.replace("_", " "), "axis": g.axis.replace("_", " "),
                  "unit": naming.unit_in_print(g.unit), "why": naming.typeset(g.why)}
                 for n, g in proposal.guesses.items()],
        "left_out": ", ".join(name.strip() for name in proposal.left_out),
        "remarks": [naming.as_sentence(text) for text in (*notes, *r.remarks)],
    }  # fmt: skip
    return render("new.html", context)


def duration_and_rate(r: Recording) -> str:
    """Return duration and rate of a recording by its clock."""
    rate = 1 / r.step
    often = f"at {significant(rate, 3)} Hz" if rate >= 0.5 else f"a row every {duration_in_words(1 / rate)}"
    return f"{duration_in_words(float(np.ptp(r.time)))} {often}"


def _answer(proposal: Proposal, count: int) -> str:
    r = proposal.recording
    if r.kind.stabilised:
        then = "`gimbalcal calibrate` this folder, best together with positions of the same unit."
        about = f"A static run of {duration_and_rate(r)}."
        return f"{about} Next: correct recording.toml where a guess below is wrong, then {then}"
    if r.kind.rotating:
        return f"Gyroscopes on a table, {duration_and_rate(r)}. {NEXT[:-1]} together with those of the other mountings."
    few = " Nine or more in different attitudes are needed for all errors of three accelerometers." if count < 9 else ""
    faces = " with `--terms bias,scale_factor`, for which six faces suffice" if 6 <= count < 9 else ""
    enough = in_several_attitudes(r, UP_AND_DOWN)
    after = f"`gimbalcal calibrate` this folder{faces}" if enough else "`gimbalcal noise` this folder"
    return (
        f"{number_of(count, 'rest')} found in {duration_in_words(float(np.ptp(r.time)))}.{few} Next: correct "
        f"recording.toml where a guess below is wrong, then {after}."
    )


def _facts(proposal: Proposal, intervals: Sequence[Dwell]) -> list[tuple[str, str]]:
    r = proposal.recording
    if not intervals:
        return [(duration_in_words(float(np.ptp(r.time))), "logged"), (f"{len(r.time):,}".replace(",", " "), "rows")]
    facts = [(str(len(intervals)), "rests"), (f"{len(r.time):,}".replace(",", " "), "rows")]
    if len(r.time) > len(intervals):  # a row for each rest has no rate
        at_rest = sum(float(r.time[d.stop - 1] - r.time[d.start]) for d in intervals)
        rate = 1 / r.step
        facts = [(f"{significant(rate, 3)} Hz", "logged"), facts[0], (duration_in_words(at_rest), "at rest"), facts[1]]
    return facts


def _offsets(r: Recording) -> list[Chart]:
    """Draw readout minus true angle of each axis, against the angle of the outermost one that is read."""
    axes = r.axes("true_angle")[:2]
    outer, charts = axes[-1], []
    for axis in axes:
        off = from_si(r.channels["gimbal_angle", axis] - r.channels["true_angle", axis], "arcsec")
        around = np.degrees(r.channels["true_angle", outer])
        title = f"{axis.replace('_', ' ')} read minus true  [arcsec]"
        charts.append(Chart((Points(around, off, COLOURS[0]),), title, f"{outer.replace('_', ' ')} [°]"))
    return charts


def _force_charts(proposal: Proposal, intervals: Sequence[Dwell]) -> list[Chart]:
    """Draw each triad over time, with dwells shaded and numbered."""
    r = proposal.recording
    t, unit = sensible_time(r.time - r.time[0])
    ends = [(float(t[d.start]), float(t[d.stop - 1])) for d in intervals]
    charts = []
    for quantity in [q for q in ("specific_force", "angular_rate") if r.has(q)]:
        axes = r.axes(quantity)
        of = "count" if r.counted(quantity) else {"specific_force": "m/s²", "angular_rate": "°/s"}[quantity]
        size = float(np.degrees(1.0)) if of == "°/s" else 1.0
        ends_of = [size * np.array([r.channels[quantity, a].min(), r.channels[quantity, a].max()]) for a in axes]
        low, high = np.full(2, np.min(ends_of)), np.full(2, np.max(ends_of))
        marks: list[Mark] = [Band(np.array(e), low, high, "grey", "" if k else "at rest") for k, e in enumerate(ends)]
        if len(intervals) <= MAX_NUMBERS and intervals:
            middle = np.array([sum(e) / 2 for e in ends])
            marks.append(Words(middle, np.full(len(intervals), np.inf), [str(d.position) for d in intervals], "grey"))
        marks += [Line(*envelope(t, size * r.channels[quantity, a]), COLOURS[i % 6], a) for i, a in enumerate(axes)]
        charts.append(Chart(tuple(marks), f"{quantity.replace('_', ' ')}  [{of}]", f"time [{unit}]"))
    return charts
