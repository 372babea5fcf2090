"""Write docs/effects.md: every physical effect of the catalogue, from its own card.

python docs/build_effects.py
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from pathlib import Path

from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.references import REFERENCES
from gimbalcal.units import from_si

PAGE = Path(__file__).parent / "effects.md"
HEAD = """# The physical effects

{count} effects, each one class in [`gimbalcal/effects`](../gimbalcal/effects) that the simulator, the estimators, the
diagnosis and the derivations share. This page is generated from their cards by `make docs`; `gimbalcal catalogue
EFFECT` shows the same card. *Usual* is the prior sigma: the size of the effect on a sensor of the class it is known
from; the diagnosis allows from a thousandth to a hundred times that. Two effects are confounded if their patterns are
the same on the usual schedules.
"""


def page() -> str:
    """Return the page as text."""
    families: dict[str, list[type[Effect]]] = {}
    for effect_id in sorted(CATALOGUE):
        families.setdefault(CATALOGUE[effect_id].__module__.rpartition(".")[2], []).append(CATALOGUE[effect_id])
    parts = [HEAD.format(count=len(CATALOGUE)).strip()]
    index = [f"* [{name}](#{name}): {', '.join(f'`{c.id}`' for c in cards)}" for name, cards in families.items()]
    parts.append("\n".join(index))
    for name, cards in families.items():
        parts += [f"## {name}", _about(cards[0]), *(card(c) for c in cards)]
    keys = sorted({key for c in CATALOGUE.values() for key in c.sources})
    parts += ["## Sources", "\n".join(f"* **{key}**: {REFERENCES[key]}" for key in keys)]
    return "\n\n".join(parts) + "\n"


def _about(c: type[Effect]) -> str:
    """Return the first sentence of the module in which a family is defined."""
    return (inspect.getmodule(c).__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")


def card(c: type[Effect]) -> str:
    """Return the section of one effect: sentence, formula, parameters, requirements, and the notes of its card."""
    text = inspect.getdoc(c) or ""
    formula = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", text, re.DOTALL)
    lead, _, rest = text.partition("\n\n")
    notes = " ".join(re.sub(r"\.\. math::.*?(?:\n\s*\n|\Z)", "", rest, flags=re.DOTALL).split())
    out = [f"### `{c.id}`", " ".join(lead.split())]
    if formula:
        out.append(f"$$ {' '.join(formula[1].split())} $$")
    out.append("\n".join(["| parameter | axes | usual | unit |", "|---|---|---|---|", *rows(c)]))
    needs = f" Needs {', '.join(c.requires)}." if c.requires else ""
    out.append(f"{notes[:1].upper()}{notes[1:]} In {', '.join(c.kinds)} recordings.{needs}".strip())
    return "\n\n".join(out)


def rows(c: type[Effect]) -> list[str]:
    """Return one line per parameter; nonlinear constants with the range of their search."""
    out = []
    for f in dataclasses.fields(c):
        m = f.metadata
        if not m:
            continue
        name = (m.get("name") or f.name).replace("_", r"\_")
        axes = ", ".join(a.replace("_", " ") for a in m["axes"] if a) or "–"
        if "sigma" in m:
            out.append(f"| {name} | {axes} | {m['sigma']:g} | {m['unit']} |")
        else:
            low, high = (float(from_si(m[k], m["unit"])) for k in ("low", "high"))
            out.append(f"| {name} (constant) | – | {low:.3g} to {high:.3g} | {m['unit']} |")
    return out


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    sys.stdout.write(f"wrote {PAGE.name}: {len(CATALOGUE)} effects\n")
