"""`gimbalcal catalogue`: cards of the physical effects, their usual sizes, and those of each grade."""

from __future__ import annotations

from pathlib import Path

import click

from gimbalcal.cli.options import FilePath, completing, effect_names, example
from gimbalcal.cli.plain_characters import say
from gimbalcal.errors import InputError


@click.command(
    epilog=example("gimbalcal catalogue gsens", "gimbalcal catalogue K3", "gimbalcal catalogue --check my_effects.py")
)
@click.argument("words", nargs=-1, metavar="[WORD]...", shell_complete=completing(effect_names))
@click.option(
    "--check", "file", type=FilePath(), metavar="FILE.py",
    help="Check the effects of a file of your own against the contract, and list them.",
)  # fmt: skip
def catalogue(words: tuple[str, ...], file: Path | None) -> None:
    """List the known physical effects, those that match every WORD, or the card of one.

    A WORD is a part of a name (gsens, worm), of a parameter (K3), or of a card (clutch); an id shows the card.
    """
    import dataclasses
    import inspect

    from gimbalcal.effects import CATALOGUE, parameters
    from gimbalcal.effects.effect import constants
    from gimbalcal.effects.sensor_grades import GRADES
    from gimbalcal.units import from_si
    from gimbalcal.words.naming import unit_in_print

    effect = " ".join(words)
    if file is not None:
        if words:
            raise InputError(f"--check takes the effects of {file} alone; leave out {effect!r}")
        _check_file(file)
    elif not words:
        _list_effects(sorted(CATALOGUE))
    elif effect in CATALOGUE:
        say(_plain_card(inspect.getdoc(CATALOGUE[effect]) or ""))
        say("")
        for f in dataclasses.fields(CATALOGUE[effect]):
            m = f.metadata
            if "sigma" in m:
                axes = ", ".join(a for a in m["axes"] if a)
                say(f"  {m['name'] or f.name} [{unit_in_print(m['unit'])}] {axes}: usually {m['sigma']:g}")
        for p in {p.name: p for p in parameters(CATALOGUE[effect])}.values():
            sizes = {name: from_si(grade.usual(p).sigma, p.unit) for name, grade in GRADES.items()}
            if len(set(sizes.values())) > 1:
                say(f"  {p.name} by grade: {', '.join(f'{size:.4g} ({name})' for name, size in sizes.items())}")
        for f in constants(CATALOGUE[effect]):
            m = f.metadata
            unit = f" [{unit_in_print(m['unit'])}]" if m["unit"] != "1" else ""
            start, low, high = (
                f"{from_si(x, m['unit']):.4g}" for x in (getattr(CATALOGUE[effect], f.name), m["low"], m["high"])
            )
            say(f"  {f.name}{unit}: usually {start}, from {low} to {high}; {m['grid'].value.partition(':')[0]}")
        say(f"  in recordings of kind {', '.join(CATALOGUE[effect].kinds)}")
    else:
        _list_effects(matching_effects(effect))


def _check_file(file: Path) -> None:
    """Print what each effect of a file adds and fits. Raises InputError for the first that breaks the contract."""
    from gimbalcal.effects import CATALOGUE, load_effects, parameters
    from gimbalcal.effects.effect import constants

    for i in load_effects(file):
        cls = CATALOGUE[i]
        names = dict.fromkeys(f"{p.name} [{p.unit}]" for p in parameters(cls, ("gimbal",)))
        fitted = ", ".join([*names, *(f"{f.name} (constant)" for f in constants(cls))])
        say(f"{i} keeps the contract: at stage {cls.stage.name} in {', '.join(cls.kinds)}; parameters {fitted}")


def _plain_card(text: str) -> str:
    """Return a card as plain text, with formulas in letters."""
    import re

    from gimbalcal.words.naming import typeset
    from gimbalcal.words.plain_formula import plain_formula

    text = re.sub(
        r"^\.\. math::((?:.+\n?)(?:[ \t]+.*\n?)*)",
        lambda m: f"  {plain_formula(m[1].strip())}\n",
        text,
        flags=re.MULTILINE,
    )
    return typeset(re.sub(r":math:`([^`]*)`", lambda m: plain_formula(m[1]), text).replace("``", "`"))


def _list_effects(names: list[str]) -> None:
    """Print a line for each effect: name and first sentence of its card."""
    import inspect

    from gimbalcal.effects import CATALOGUE

    wide = max(map(len, names))
    for name in names:
        say(f"{name:{wide}s}  {(inspect.getdoc(CATALOGUE[name]) or '').splitlines()[0]}")


def matching_effects(words: str) -> list[str]:
    """Return effects whose name or parameters have all the words; else those whose card has them.

    Names are compared without their blanks: "gsens" matches gyro_g_sensitivity_rate. Raises InputError for none.
    """
    import inspect
    from difflib import get_close_matches

    from gimbalcal.effects import CATALOGUE, parameters

    wanted = words.lower().replace("_", " ").replace("-", " ").split()
    named = {n: {n.replace("_", ""), *(p.name.lower() for p in parameters(CATALOGUE[n]))} for n in sorted(CATALOGUE)}
    names = [n for n, known in named.items() if wanted and all(any(w in k for k in known) for w in wanted)]
    cards = {n: (inspect.getdoc(CATALOGUE[n]) or "").lower() for n in sorted(CATALOGUE)}
    matches = names or [n for n, card in cards.items() if wanted and all(w in card for w in wanted)]
    if not matches:
        similar = get_close_matches("_".join(wanted), CATALOGUE, 1)
        hint = f"did you mean {similar[0]}?" if similar else "`gimbalcal catalogue` lists them"
        raise InputError(f"no effect is called {words!r}, and no card speaks of it; {hint}")
    return matches
