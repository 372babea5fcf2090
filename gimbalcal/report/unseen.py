"""What would have shown in a recording that lacks nothing, as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gimbalcal.report import wording
from gimbalcal.report.rounding import significant


def unseen_rows(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """Cause, size from which on it shows, usual size, unit; of all views. Nothing where something is missing."""
    if content["verdict"] != "adequate":
        return []
    fit = content["fit"]
    told = (u for part in (fit.get("views") or {"": fit}).values() for u in part.get("unseen", ()))
    return [
        {"words": wording.named(u["effect"], u["axis"].replace("_", " ")), "least": significant(u["least"], 2),
         "usual": significant(u["usual"], 2), "unit": wording.unit_in_print(u["unit"])}
        for u in told
    ]  # fmt: skip
