"""The physical effects that are known, on the terminal: cards, usual sizes, and what a grade makes of them."""

from __future__ import annotations

import click

from gimbalcal.errors import InputError


@click.command()
@click.argument("effect", required=False)
def catalogue(effect: str | None) -> None:
    """List the physical effects that are known, or show the card of one EFFECT."""
    import dataclasses
    import inspect

    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.effects.grade import GRADES
    from gimbalcal.units import from_si

    if effect is None:
        for name in sorted(CATALOGUE):
            print(f"{name:28s} {(inspect.getdoc(CATALOGUE[name]) or '').splitlines()[0].lstrip('r')}")
    elif effect in CATALOGUE:
        print(inspect.getdoc(CATALOGUE[effect]))
        print()
        for f in dataclasses.fields(CATALOGUE[effect]):
            m = f.metadata
            if m.get("kind") == "parameter":
                axes = ", ".join(a for a in m["axes"] if a)
                print(f"  {m['name'] or f.name} [{m['unit']}] {axes}: usually {m['sigma']:g}")
        for p in {p.name: p for p in parameters(CATALOGUE[effect])}.values():
            sizes = {name: from_si(grade.usual(p).sigma, p.unit) for name, grade in GRADES.items()}
            if len(set(sizes.values())) > 1:
                print(f"  {p.name} by grade: {', '.join(f'{size:.4g} ({name})' for name, size in sizes.items())}")
        print(f"  in recordings of kind {', '.join(CATALOGUE[effect].kinds)}")
    else:
        raise InputError(f"no effect is called {effect!r}; `gimbalcal catalogue` lists them")
