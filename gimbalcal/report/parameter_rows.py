"""The calibration as a table, one row a parameter: those that the data tell first, the others below them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gimbalcal.calibration import Counts
from gimbalcal.calibration.readout import from_content
from gimbalcal.report import wording
from gimbalcal.report.rounding import minus, pdg, significant, told_from_zero
from gimbalcal.report.wording import label_of
from gimbalcal.units import from_si, to_si

Row = Mapping[str, Any]


def rows(content: Mapping[str, Any], truth: Mapping[str, float] | None) -> list[dict[str, Any]]:
    """The rows of the calibration table; `group` opens a line, `below` opens those that the data do not tell alone."""
    in_unobservable = wording.unobservable_leading(wording.unobservable_of(content))
    told = [p for p in content["parameters"] if label_of(p) not in in_unobservable]
    rest = [p for p in content["parameters"] if label_of(p) in in_unobservable]
    nominal = from_content(content).accelerometers
    out: list[dict[str, Any]] = []
    for part in (told, rest):
        for i, p in enumerate(part):
            new = not i or p["name"] != part[i - 1]["name"]
            out.append(
                {**_row(p, nominal, truth), "first": new, "unobservable": part is rest, "below": part is rest and not i}
            )
    return out


def _row(p: Row, nominal: Counts | None, truth: Mapping[str, float] | None) -> dict[str, Any]:
    value, sigma, unit = as_printed(p, p["value"], p["sigma"], nominal)
    moved = p["value"] / p["prior_sigma"] if p["prior_sigma"] else 0.0
    error = ""
    if truth is not None and label_of(p) in truth and p["sigma"] > 0:
        error = in_sigmas((p["value"] - float(from_si(truth[label_of(p)], p["unit"]))) / p["sigma"], 1)
    own = unit == wording.unit_in_print(p["unit"])  # else counted from a nominal value that the same data gave
    return {
        "words": wording.named(p["name"], p["axis"].replace("_", " ")) + (", as stated" if p["sigma"] == 0 else ""),
        "means": wording.typeset(p.get("in_words", "")) if own and told_from_zero(p["value"], p["sigma"]) else "",
        "value": value,
        "sigma": sigma,
        "unit": unit,
        "prior": significant(p["prior_sigma"], 2) if own else "",
        "moved": moved,
        "moved_text": in_sigmas(moved, 2 if abs(moved) < 1000 else 0) if own else "",
        "error": error,
    }


def in_sigmas(x: float, places: int) -> str:
    """A signed number of sigmas as printed; zero has no sign.

    >>> in_sigmas(-1.26, 1), in_sigmas(-0.01, 1)
    ('−1.3 σ', '0.0 σ')
    """
    text = f"{x:+.{places}f}"
    return minus(text if text.strip("+-0.") else text[1:]) + " σ"


def as_printed(p: Row, value: float, sigma: float, nominal: Counts | None) -> tuple[str, str, str]:
    """Value, sigma and unit of a parameter as printed, from its value and sigma in its own unit.

    Where readings are counts N of nominal scale k and offset N_0, the model reads k (N - N_0) = f / (1 + s) + b, so
    that f = k (1 + s) (N - N_0 - b / k): then it is the scale k (1 + s) and the offset N_0 + b / k that are told.
    """
    unit = wording.unit_in_print(p["unit"])
    if nominal is not None and p.get("effect") in ("scale_factor", "bias") and p["axis"] in ("x", "y", "z"):
        k, zero = (x["xyz".index(p["axis"])] for x in (nominal.scale, nominal.offset))
        x, dx = float(to_si(value, p["unit"])), float(to_si(sigma, p["unit"]))
        if p["effect"] == "scale_factor":
            value, sigma, unit = 1e6 * k * (1 + x), 1e6 * abs(k) * dx, "µm/s²/count"
        else:
            value, sigma, unit = zero + x / k, dx / abs(k), "counts"
    told, spread = pdg(value, sigma)
    return minus(told), spread, unit


def nominal_in_words(content: Mapping[str, Any]) -> str:
    """What the numbers of a unit that reads in counts mean, in sentences; else empty."""
    sentences = []
    readout = from_content(content)
    if readout.accelerometers is not None:
        counts = readout.accelerometers
        scale, offset = (", ".join(f"{v:.7g}" for v in x) for x in (counts.scale, counts.offset))
        sentences.append(
            "The accelerometers read in counts: scale factor is the acceleration of one count, bias the count at zero "
            f"acceleration. In calibration.json both are errors of a nominal {scale} m/s² per count from {offset} "
            "counts (x, y, z), which this same recording gave, and so next to zero there."
        )
    if readout.gyroscopes is not None:
        scale = f"{float(from_si(readout.gyroscopes.scale[0], 'deg/s')):.7g}"
        sentences.append(f"The gyroscopes read in counts: their numbers hold after a nominal {scale} °/s per count.")
    return " ".join(sentences)
