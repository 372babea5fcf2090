"""What an effect says of itself: what its numbers mean, and whether it belongs to one recording."""

from __future__ import annotations

import re
from typing import Any

from gimbalcal.effects.effect import Effect, constants
from gimbalcal.effects.stimulus import REFERENCE_TEMPERATURE


def equation(cls: type[Effect]) -> str:
    """The formula of an effect's card, LaTeX; empty where it has none."""
    found = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", cls.__doc__ or "", re.DOTALL)
    return " ".join(found[1].split()) if found else ""


def stated_law(cls: type[Effect]) -> dict[str, Any]:
    """What the numbers of an effect mean: its equation, and T0 in degC where it follows the temperature."""
    told: dict[str, Any] = {"effect": cls.id, "equation": equation(cls)}
    return told | ({"T0_degC": REFERENCE_TEMPERATURE} if "temperature" in cls.requires else {})


def happens_once(cls: type[Effect]) -> bool:
    """Whether an effect is something that happened in one recording, and says nothing of another."""
    return any(f.metadata["grid"].once for f in constants(cls))
