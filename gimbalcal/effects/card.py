"""What an effect says of itself: what its numbers mean, and whether it belongs to one recording."""

from __future__ import annotations

import re
from typing import Any

from gimbalcal.effects.effect import Effect, constants
from gimbalcal.effects.stimulus import REFERENCE_TEMPERATURE


def equation(cls: type[Effect]) -> str:
    """Return the formula of an effect's card, LaTeX; empty where it has none."""
    match = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", cls.__doc__ or "", re.DOTALL)
    return " ".join(match[1].split()) if match else ""


def stated_law(cls: type[Effect]) -> dict[str, Any]:
    """Return the meaning of an effect's numbers: its equation, and T0 in degC where it follows the temperature."""
    law: dict[str, Any] = {"effect": cls.id, "equation": equation(cls)}
    return law | ({"T0_degC": REFERENCE_TEMPERATURE} if "temperature" in cls.requires else {})


def happens_once(cls: type[Effect]) -> bool:
    """Return whether an effect is an event of one recording, of no meaning for another."""
    return any(f.metadata["grid"].once for f in constants(cls))
