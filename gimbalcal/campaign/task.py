"""What one share of a campaign computes: a few runs, to columns. Pure: text and numbers in, columns out."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gimbalcal.entries import Entry, Json
from gimbalcal.errors import InputError
from gimbalcal.recording.document import Document

if TYPE_CHECKING:  # what computes is imported by who computes
    from gimbalcal.calibration import Calibration
    from gimbalcal.effects import Effect, Parameter
    from gimbalcal.number import Array
    from gimbalcal.recording import Recording

COLUMNS = ("run", "parameter", "unit", "truth", "estimate", "sigma", "chi2", "dof", "outcome")
METHODS = ("three-stage", "multiposition")
RUNS_PER_SHARE = 4  # runs of a share that are simulated one by one, a second or so each: little is lost with a worker
SOLVED = 100  # runs of a share of pulses, which are solved as one array
SHIPPED = Path(__file__).parent


class PulseTriad(NamedTuple):
    """A triad that counts pulses: its name in `trials`, the SI unit that it senses, its scale orders, and the dof."""

    triad: str
    unit: str
    orders: int
    dof: int


PULSES = {
    "accelerometer-pulses": PulseTriad("accelerometers", "m/s^2", 3, 0),  # 15 norms for 15 unknowns
    "gyroscope-pulses": PulseTriad("gyroscopes", "rad/s", 2, 9 * 3 + 15 - 12),  # 9 turns of 3 and 15 norms for 12
}


@dataclass(frozen=True)
class Identity(Entry):
    """What must agree for a stopped campaign to go on: everything that a run depends on, texts by their SHA-256."""

    scenario: str
    name: str
    kind: str
    seed: int
    method: str
    share: int
    version: str
    effects: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Task:
    """A campaign without its size: the scenario's text, its seed, the method, and how many runs make a share.

    effects: name and text of each file of a user's effects, since a worker has none of them.
    """

    name: str
    text: str
    kind: str
    seed: int
    method: str
    share: int
    effects: tuple[tuple[str, str], ...] = ()

    @property
    def pulses(self) -> PulseTriad | None:
        """Return the triad whose pulses are counted in its runs; None where they are simulated recordings."""
        return PULSES.get(self.kind)

    @property
    def direction(self) -> str:
        """Return whether coefficients turn readings (here pulses) into physics, or physics into readings."""
        return "pulses to physics" if self.pulses else "physics to readings"

    @property
    def identity(self) -> Identity:
        """Return what must agree for a stopped campaign to go on."""
        from gimbalcal import __version__

        scenario, *own = (sha256(text.encode()).hexdigest() for text in (self.text, *(t for _, t in self.effects)))
        return Identity(
            scenario, self.name, self.kind, self.seed, self.method, self.share, __version__, tuple(own) or None
        )


def task(scenario: str | Path, method: str = "three-stage", seed: int | None = None) -> Task:
    """Read and check a scenario: one of `simulate`, or one of pulses (kind accelerometer-pulses, gyroscope-pulses)."""
    path = _find(scenario)
    document = Document(path)
    text, content = "\n".join(document.lines), document.content
    kind, own_texts = str(content.get("kind")), tuple[tuple[str, str], ...]()
    share = RUNS_PER_SHARE
    if kind in PULSES:
        _check_pulses(path, content)
        method, share = kind, SOLVED
    else:
        from gimbalcal.effects.loading import loaded_texts
        from gimbalcal.simulate import check_content, prepare

        prepare(check_content(content, str(path)))
        if method not in METHODS:
            raise InputError(f"method {method!r} is not known; choose {' or '.join(METHODS)}")
        own_texts = loaded_texts()
    given = int(content.get("seed", 1)) if seed is None else seed
    return Task(path.stem, text, kind, given, method, share, own_texts)


def _find(scenario: str | Path) -> Path:
    shipped = SHIPPED / f"{Path(scenario).name}.toml"
    if not Path(scenario).is_file() and shipped.is_file():
        return shipped
    from gimbalcal.simulate.scenario import find

    return find(scenario)


def _check_pulses(path: Path, content: Json) -> None:
    known = {"format", "kind", "title", "seed", "turntable"}
    unknown = sorted(set(content) - known)
    if unknown:
        raise InputError(f"{path}: {unknown[0]!r} is not known; a scenario of pulses has {', '.join(sorted(known))}")
    seed = content.get("seed", 1)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"{path}: seed must be a whole number from 0, got {seed!r}")
    _turntable(content, str(path))


def _turntable(content: Json, where: str) -> float:
    """Return the one-sigma turntable error [rad]."""
    from gimbalcal.quantities import refuse_unit
    from gimbalcal.units import to_si

    given = content.get("turntable")
    if not isinstance(given, dict) or set(given) != {"value", "unit"} or not isinstance(given["value"], int | float):
        raise InputError(f'{where}: give the turntable error as turntable = {{ value = 3.0, unit = "arcsec" }}')
    refuse_unit(str(given["unit"]), "angle")
    size = float(to_si(float(given["value"]), str(given["unit"])))
    if not 0 <= size < 0.2:
        raise InputError(f"{where}: turntable must lie between 0 and 0.2 rad, got {size:g} rad")
    return size


def compute_runs(what: Task, runs: range) -> dict[str, list[Any]]:
    """Return columns (see COLUMNS) of these runs; runs that fail carry a sentence in `outcome` and no estimate."""
    from threadpoolctl import threadpool_limits

    if what.effects:
        from gimbalcal.effects.loading import load_text

        for name, source in what.effects:
            load_text(name, source)
    with threadpool_limits(limits=1):  # small matrices: a second thread only waits, and sums in another order
        if what.pulses:
            return _pulses(what, what.pulses, runs)
        columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
        for run in runs:
            for name, column in _simulated(what, run).items():
                columns[name] += column
        return columns


def _pulses(what: Task, pulses: PulseTriad, runs: range) -> dict[str, list[Any]]:
    from gimbalcal.campaign import trials as simulated

    trials = getattr(simulated, pulses.triad)(what.seed, runs, _turntable(tomllib.loads(what.text), what.name))
    scale = [f"{pulses.unit}/(pulse/s)" + (f"^{k}" if k > 1 else "") for k in (1, 2, 3)[: pulses.orders]]
    pairs = [(f"K{k}:{a}", unit) for k, unit in enumerate(scale, 1) for a in "xyz"]
    pairs += [*((f"bias:{a}", pulses.unit) for a in "xyz"), *((f"E:{a}", "rad") for a in ("yx", "zx", "zy"))]
    kept = [*range(3 * pulses.orders), *range(9, 15)]
    truth, x, sigma = trials.truth.vector(), trials.fit.pulses.vector(), trials.fit.sigma
    n = len(runs)
    outcome = ["" if ok else "the fit did not settle" for ok in trials.fit.converged]
    return {
        "run": np.repeat(np.array(runs), len(kept)).tolist(),
        "parameter": [name for name, _ in pairs] * n,
        "unit": [unit for _, unit in pairs] * n,
        "truth": truth[:, kept].ravel().tolist(),
        "estimate": x[:, kept].ravel().tolist(),
        "sigma": sigma[:, kept].ravel().tolist(),
        "chi2": np.repeat(trials.fit.chi2, len(kept)).tolist(),
        "dof": [pulses.dof] * (n * len(kept)),
        "outcome": [o for o in outcome for _ in kept],
    }


def seed_of(seed: int, run: int) -> int:
    """Return the seed of one run: 63 bits from the campaign's seed and the number of the run."""
    return int(np.random.SeedSequence([seed, run]).generate_state(1, np.uint64)[0] >> np.uint64(1))


def _simulated(what: Task, run: int) -> dict[str, list[Any]]:
    from gimbalcal.simulate import check_content, simulate

    content = tomllib.loads(what.text)
    recording, effects = simulate(content, seed_of(what.seed, run))
    try:
        calibration = _calibrated(what.method, recording)
    except InputError as problem:
        return _failed_run(run, str(problem))
    truth = _comparable_truth(effects, calibration.parameters, what.method)
    if recording.kind.stabilised:
        truth = _on_the_clock(
            truth, calibration.parameters, recording, check_content(content, what.name).schedule.start_angle
        )
    n = len(calibration.parameters)
    return {
        "run": [run] * n,
        "parameter": [p.label for p in calibration.parameters],
        "unit": ["SI"] * n,
        "truth": truth.tolist(),
        "estimate": calibration.values.tolist(),
        "sigma": calibration.sigmas.tolist(),
        "chi2": [float(calibration.residual.chi2)] * n,
        "dof": [int(calibration.residual.dof)] * n,
        "outcome": [calibration.outcome] * n,
    }


def _calibrated(method: str, recording: Recording) -> Calibration:
    if method == "multiposition":
        from gimbalcal.estimate.unit import inertial_unit

        return inertial_unit(recording)
    from gimbalcal.pipeline import three_stage

    return three_stage([recording])


def _failed_run(run: int, why: str) -> dict[str, list[Any]]:
    nan = float("nan")
    row = (run, "", "SI", nan, nan, nan, nan, 0, why)
    return {name: [value] for name, value in zip(COLUMNS, row, strict=True)}


def _on_the_clock(truth: Array, wanted: Sequence[Parameter], recording: Recording, start: float) -> Array:
    """Return the truth (p,) with S_t counted as in an estimate: its constant is the mean of the platform gimbal.

    A platform that is turned by phi_0 against the true S_t is turned by R(phi_0) R_z(delta) against this one.
    """
    from gimbalcal.kinematics import sidereal_phase
    from gimbalcal.rotation import tilt_rotation

    at = [k for k, p in enumerate(wanted) if p.effect == "polar_axis_misalignment"]
    if len(at) != 3 or ("gimbal_angle", "platform") not in recording.channels:
        return truth
    delta = np.angle(np.exp(1j * (sidereal_phase(recording, recording.angles())[0] - start)))
    C = tilt_rotation(truth[at]) @ tilt_rotation([0.0, 0.0, delta])
    out = np.array(truth)
    out[at] = np.arctan2(-C[2, 1], C[2, 2]), np.arcsin(C[2, 0]), np.arctan2(-C[1, 0], C[0, 0])
    return out


def _comparable_truth(effects: Sequence[Effect], wanted: Sequence[Parameter], method: str) -> Array:
    """Return the truth (p,) in the convention of the estimate: without angles the first axes fix the triad's rotation.

    The accelerometers' frame so turned is that of the gyroscopes too; to first order in the misalignments.
    """
    from gimbalcal.effects import values
    from gimbalcal.effects.accelerometer import Misalignment

    truth = values(effects, wanted)
    if method != "multiposition":
        return truth
    beta = next((e.beta for e in effects if isinstance(e, Misalignment)), None)
    if beta is None:
        return truth
    xy, xz, _, yx, _, _ = beta
    # a rotation of the triad changes xz and yz, xy and zy, yx and zx alike, of either triad
    turned = {("misalignment", axis): by for axis, by in (("yz", xz), ("zy", xy), ("zx", yx))}
    alike = {"xy": xy, "xz": xz, "yz": xz, "yx": yx, "zx": yx, "zy": xy}
    turned |= {("gyro_misalignment", axis): by for axis, by in alike.items()}
    return truth - np.array([turned.get((p.effect, p.axis), 0.0) for p in wanted])
