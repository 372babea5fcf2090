"""Effects written by a user: from a file (`--effects FILE.py`), or of an installed package.

Loaded effects are added to the catalogue and work like those of the package. Before that the contract of each new
effect is tested on a simulated stimulus, because a contribution that is not zero when absent, or whose derivative is
lost, would corrupt every fit without a message.
"""

from __future__ import annotations

import dataclasses
import sys
import traceback
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from gimbalcal.effects.effect import (
    CATALOGUE,
    EVERY_KIND,
    NEEDS,
    Domain,
    Effect,
    Stage,
    Stimulus,
    constants,
    parameters,
    with_values,
    zero_effect,
)
from gimbalcal.effects.grids import range_beyond
from gimbalcal.entries import Entry
from gimbalcal.errors import InputError
from gimbalcal.number import STEP, Array
from gimbalcal.units import from_si, parse

GROUP = "gimbalcal.effects"  # of entry points: a package names a module here, whose import defines the effects
GIMBALS = ("inner", "middle", "outer")
MAX_FILE_BYTES = 1e6  # bytes of a file of effects
_loaded: dict[str, tuple[str, tuple[str, ...]]] = {}  # by path: the text that was run, and the ids that it defined
_installed: dict[str, tuple[str, tuple[str, ...]]] = {}  # the same of modules that installed packages name


def load_effects(path: str | Path) -> tuple[str, ...]:
    """Enter the effects that a Python file defines into the catalogue and return their ids.

    A file that was loaded before is run again if its text is another one. Raises InputError, naming file and line, for
    what cannot be run, for an id that is taken, and for an effect that breaks the contract; nothing is entered then.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"there is no file {path}; --effects takes a Python file with classes under @effect")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise InputError(f"{path} has {path.stat().st_size / 1e6:.0f} MB, which no file of effects has")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not UTF-8 text; --effects takes a Python file with classes under @effect"
        ) from None
    return load_text(str(path), text)


def load_text(name: str, text: str) -> tuple[str, ...]:
    """Enter the effects that the text of a file defines; `name` is what it is called."""
    before, ids = _loaded.get(name, ("", ()))
    if before == text and ids:
        return ids
    replaced = {i: CATALOGUE.pop(i) for i in ids if i in CATALOGUE}  # what its earlier text defined
    try:
        new = _enter_effects(name, lambda: _run(name, text))
    except InputError:
        CATALOGUE.update(replaced)
        raise
    if not new:
        CATALOGUE.update(replaced)
        raise InputError(f"{name} defines no effect; write a class under @effect as docs/api.md shows")
    _loaded[name] = (text, new)
    return new


@contextmanager
def temporarily_loaded(name: str, text: str) -> Iterator[tuple[str, ...]]:
    """Enter the effects of a text, yield their ids, and take them out of the catalogue again."""
    ids = load_text(name, text)
    try:
        yield ids
    finally:
        for i in ids:
            CATALOGUE.pop(i, None)
        del _loaded[name]


def loaded_texts() -> tuple[tuple[str, str], ...]:
    """Return the name and text of every file that was loaded, for processes that have to load them again."""
    return tuple((name, text) for name, (text, _) in _loaded.items())


def load_installed() -> None:
    """Import every module that an installed package names under the entry points `gimbalcal.effects`."""
    for point in entry_points(group=GROUP):
        if new := _enter_effects(f"the installed package behind {GROUP} / {point.name}", point.load):
            file = Path(getattr(sys.modules.get(point.module), "__file__", None) or point.module)
            _installed[str(file)] = file.read_text(encoding="utf-8") if file.is_file() else point.value, new


@dataclass(frozen=True)
class EffectFile(Entry):
    """A file of effects of a user's own: SHA-256 of the text that was run, and the ids that it defines."""

    path: str
    sha256: str
    effects: tuple[str, ...]


def files_outside(ids: Collection[str] | None = None) -> tuple[EffectFile, ...]:
    """Return the files that define effects which are not of this package.

    ids: those that are asked for; all that are loaded where none are named.
    """
    rows = []
    for path, (text, defined) in (_loaded | _installed).items():
        wanted = tuple(i for i in defined if i in CATALOGUE and (ids is None or i in ids))
        if wanted:
            rows.append(EffectFile(path, sha256(text.encode()).hexdigest(), wanted))
    return tuple(rows)


def _enter_effects(name: str, run: Callable[[], object]) -> tuple[str, ...]:
    """Return the ids that a run adds to the catalogue; none is entered where one breaks the contract."""
    before = set(CATALOGUE)
    broken = ""
    try:
        run()
    except (Exception, SystemExit) as problem:  # noqa: BLE001  whatever a user's file does
        broken = f"{name}{_line(problem, name)}: {_reason(problem)}"
    new = tuple(i for i in CATALOGUE if i not in before)
    if not broken:
        refused = ((i, contract_breach(CATALOGUE[i])) for i in new)
        broken = next((f"{name}: the effect {i!r} {why}" for i, why in refused if why), "")
    if broken:
        for i in new:
            del CATALOGUE[i]
        raise InputError(broken)
    return new


def _run(name: str, text: str) -> None:
    module = ModuleType(f"gimbalcal_effects_{abs(hash(name)):x}")
    module.__file__ = name
    sys.modules[module.__name__] = module  # dataclasses look their annotations up there
    exec(compile(text, name, "exec"), module.__dict__)  # noqa: S102  a file that the user named


def _line(problem: BaseException, name: str) -> str:
    if isinstance(problem, SyntaxError) and problem.filename == name:
        return f" line {problem.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(problem.__traceback__) if frame.filename == name]
    return f" line {lines[-1]}" if lines else ""


def _reason(problem: BaseException) -> str:
    sentence = problem.msg if isinstance(problem, SyntaxError) else str(problem)
    ours = isinstance(problem, ValueError)  # sentences of this package
    return sentence if ours and sentence else f"{type(problem).__name__}: {sentence}".rstrip(": ")


def contract_breach(cls: type[Effect]) -> str:
    """Return a sentence on what an effect breaks of the contract, to follow its id; empty where it keeps it."""
    try:
        return _missing_declaration(cls) or _law_breach(cls)
    except InputError as problem:
        return f"cannot be used: {problem}"
    except Exception as problem:  # noqa: BLE001  whatever a user's contribution does
        return f"fails on a recording that has everything: {type(problem).__name__}: {problem}"


def _missing_declaration(cls: type[Effect]) -> str:
    """Return a sentence on what is missing from the declaration of an effect; empty if nothing is."""
    if not str(cls.id).isidentifier():
        return "has an id that is no name; write letters, digits and _"
    if (cls.__doc__ or "").startswith(f"{cls.__name__}("):
        return "says nothing of itself; give the class a docstring whose first sentence says what it does"
    if not isinstance(getattr(cls, "stage", None), Stage):
        return f"says no stage; write stage = Stage.NAME with one of {', '.join(s.name for s in Stage)}"
    if wrong := [k for k in cls.kinds if k not in EVERY_KIND]:
        return f"names a kind of recording {wrong[0]!r}; there are {', '.join(EVERY_KIND)}"
    if wrong := [need for need in cls.requires if need not in NEEDS and not need.startswith("covariate:")]:
        return f"requires {wrong[0]!r}; an effect may require {', '.join(NEEDS)} or covariate:NAME"
    own = parameters(cls, GIMBALS, constants=True)
    if not any("." not in p.name for p in own):
        return "has no parameter; give it one with parameter(axes, unit=..., sigma=...)"
    for p in own:
        parse(p.unit)
        if not p.sigma > 0:
            return f"has a parameter {p.name} whose sigma (or range) is {p.sigma:g}; it must be above zero"
    for f in constants(cls):
        default, unit = float(getattr(zero_effect(cls), f.name)), f.metadata["unit"]
        if ends := range_beyond(f, default):
            where = f"{from_si(default, unit):g}, outside its range of {' to '.join(ends)} {unit}".rstrip()
            return f"has a constant {f.name} of {where}; its numbers are in SI"
    taken = {p.name: i for i, c in CATALOGUE.items() if i != cls.id for p in parameters(c, GIMBALS, constants=True)}
    if double := [p.name for p in own if p.name in taken]:
        return f"calls a parameter {double[0]!r}, as {taken[double[0]]} does; choose another name"
    return ""


def _law_breach(cls: type[Effect]) -> str:
    """Return a sentence on the law that a contribution breaks: zero when absent, shape, exact derivative, linearity."""
    s, effect = example_stimulus(cls), zero_effect(cls, GIMBALS)
    n, k = s.readout.shape
    shape = {Stage.ENCODER: (n, k), Stage.AXIS_TILT: (n, k, 3)}.get(cls.stage, (n, 3))
    none = np.asarray(effect.contribution(s))
    if np.broadcast_shapes(none.shape, shape) != none.shape:
        return f"adds an array of shape {none.shape}, and at the stage {cls.stage.name} it is {shape}"
    if np.any(none):
        return "adds something although its parameters are zero; zero must mean absent"
    wanted = parameters(cls, GIMBALS)
    sigma, rng = np.array([p.sigma for p in wanted]), np.random.default_rng(1)
    x, way = rng.uniform(0.5, 1.5, len(wanted)) * sigma, rng.uniform(0.5, 1.5, len(wanted)) * sigma

    def added(step: complex) -> Array:
        return np.asarray(with_values([effect], wanted, x + step * way, GIMBALS)[0].contribution(s))

    if why := next((why for d in cls.domain if (why := _domain(d, s))), ""):
        return why
    at = added(0.0)
    if not np.all(np.isfinite(at)):
        return "adds what is not finite for parameters of its usual size"
    exact = added(1j * STEP).imag / STEP
    if _loses_derivative(added, 1e-5, 1e-8 * float(np.abs(at).max())):
        return "loses its derivative; take absolute, sin, exp, ... from gimbalcal.number instead of numpy or math"
    if cls.linear and np.abs(added(1.0) - at - exact).max() > 1e-9 * np.abs(at).max():
        return "is not linear in its parameters; make what enters otherwise a constant, or write linear = False"
    (sized,) = with_values([effect], wanted, x, GIMBALS)
    return _by_force(sized, s) or _of_other_rows(sized, s) or _smooth_constants(sized, s)


def _loses_derivative(added: Callable[[complex], Array], h: float, least: float) -> bool:
    """Return whether the complex step of a contribution is not its central difference of step h, to `least`."""
    exact, difference = np.imag(added(1j * STEP)) / STEP, np.real(added(h) - added(-h)) / (2 * h)
    return bool(np.abs(exact - difference).max() > 1e-4 * np.abs(difference).max() + least)


def _by_force(sized: Effect, s: Stimulus) -> str:
    """Return whether the effect has no exact derivative by the force, through which errors before it reach it."""

    def added(step: complex) -> Array:
        return np.asarray(sized.contribution(s.at(force=s.force * (1 + step))))

    if _loses_derivative(added, 1e-6, 1e-6 * float(np.abs(added(0.0)).max())):
        return "loses its derivative by the force; take absolute, sin, exp, ... from gimbalcal.number"
    return ""


def _of_other_rows(sized: Effect, s: Stimulus) -> str:
    """Return whether the effect follows the force or the angle at other rows without saying so.

    The platform turns first of all, by the force of its drawing, to which no other effect adds.
    """
    if sized.spans_rows or sized.stage is Stage.PLATFORM:
        return ""
    first = (np.arange(len(s.time)) < len(s.time) // 2)[:, None]
    moved = s.at(force=s.force * (1 + 0.1 * first), angle=s.angle + 0.1 * first)
    late, kept = (np.asarray(sized.contribution(each))[~first[:, 0]] for each in (moved, s))
    if np.abs(late - kept).max() > 1e-9 * np.abs(kept).max():
        return "follows the force or the angle at other rows; write spans_rows = True"
    return ""


def _domain(d: object, s: Stimulus) -> str:
    """Return what is wrong with an entry of `domain`, evaluated on a stimulus; empty if nothing is."""
    if not isinstance(d, Domain):
        return f"has the domain {d!r}; write Domain(name, unit, low, high, lambda s: ...)"
    if not d.low < d.high or np.shape(d.value(s)) != s.time.shape:
        return f"has a domain of {d.name} that is no range of a variable (n,) of the stimulus"
    d.exceeded(s)
    return ""


def _smooth_constants(sized: Effect, s: Stimulus) -> str:
    """Return which smooth constant the effect has no exact derivative by; a fit needs it as it does that by sizes."""
    at = np.abs(sized.contribution(s)).max()
    for f in constants(type(sized)):
        if not f.metadata["grid"].smooth:
            continue
        value = float(getattr(sized, f.name))
        unit = abs(value) or f.metadata["high"] - f.metadata["low"]

        def added(step: complex, f: Any = f, value: float = value, unit: float = unit) -> Array:
            return np.asarray(dataclasses.replace(sized, **{f.name: value + step * unit}).contribution(s))

        # relative: the phase of a short period runs through thousands of radians
        if _loses_derivative(added, 1e-8, 1e-6 * at):
            return f"loses its derivative by {f.name}; take absolute, sin, exp, ... from gimbalcal.number"
    return ""


def example_stimulus(cls: type[Effect]) -> Stimulus:
    """Return a made-up stimulus (12 rows, three gimbals) that has everything an effect may ask for."""
    rng = np.random.default_rng(0)
    n, k = 12, len(GIMBALS)
    visit = np.arange(n) // 3
    names = {need.partition(":")[2] or "logged" for need in cls.requires if need.startswith("covariate")} or {"logged"}
    many = (rng.uniform(0.3, 0.9, (n, 3)) for _ in range(8))
    force, move, earlier, rate, target, slope, one, other = many
    return Stimulus(
        time=600.0 * np.arange(n), readout=one, angle=one + 1e-6 * other, force=9.8 * force, gravity=9.8, visit=visit,
        position=visit + 1, since_move=600.0 * (np.arange(n) % 3), move_force=move, move_angle=other,
        earlier_move_force=earlier, rate=0.1 * rate, axis_names=GIMBALS, latitude=0.7, target=target,
        true_angle=one, aimed=rng.uniform(size=(n, 3, 2)), temperature=20 + 5 * rng.uniform(size=n),
        covariates={name: rng.uniform(1, 2, n) for name in sorted(names)}, axis_directions=("x", "y", "z"),
        sense=(1,) * k, attitude=np.broadcast_to(np.eye(3), (n, 3, 3)), load=rng.uniform(size=(n, k, 3)),
        rate_slope=0.01 * slope,
    )  # fmt: skip
