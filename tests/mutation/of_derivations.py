"""Errors anywhere between a recording and a calibration, a navigation or a budget: do the derivations notice them?

    python -m tests.mutation.of_derivations [WORD ...]     all, or those whose module or text contains a word

Each error replaces one piece of text of one module. What is derived is computed once; then each error is tried in a
process of its own, which imports the package anew with the text replaced and runs the comparisons of `derivations`,
those of the changed module first, until one differs. The exit status is 1 where more than `MOST_UNDETECTED` errors go
undetected.
"""

import math
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from typing import Any

from tests.paths import ROOT

PACKAGE = "gimbalcal"
MOST_UNDETECTED = 3
TIMES = 5  # the processor time of all comparisons; an error with which they do not come to an end is detected
OUTDATED = 2
Comparable = tuple[str, Callable[[], float]]  # place of the package and what compares it


@dataclass(frozen=True)
class Error:
    """Text of a module of the package, which stands there once, and what stands in its place."""

    module: str
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.module}: {self.before}  ->  {self.after}"


ERRORS = tuple(Error(*e) for e in (
    # Earth, rotations, what a recording says of the hardware
    ("earth", "np.stack([c, np.zeros_like(c), -s]", "np.stack([s, np.zeros_like(c), -c]"),
    ("earth", "w**1.5", "w**0.5"),
    ("earth", "- 2 / a * slope * height", "+ 2 / a * slope * height"),
    ("rotation", "np.eye(3) - s * X + c * (X @ X)", "np.eye(3) + s * X + c * (X @ X)"),
    ("rotation", "np.cross(rate[:-1], rate[1:]) * dt / 12", "np.cross(rate[1:], rate[:-1]) * dt / 12"),
    ("rotation", "bend = (slope[:-1] - slope[1:])", "bend = (slope[1:] - slope[:-1])"),
    ("kinematics", "return -recording.site.gravity * apply", "return recording.site.gravity * apply"),
    ("kinematics", "[cos(phase) * along, sin(phase) * along,", "[cos(phase) * along, -sin(phase) * along,"),
    ("kinematics", "float(np.median(h)) / 2 if", "float(np.median(h)) if"),
    ("kinematics", "np.asarray(turned + np.angle", "np.asarray(turned - np.angle"),
    ("kinematics", "np.arctan2(f[:, 1], f[:, 0])", "np.arctan2(f[:, 0], f[:, 1])"),
    ("views.known_attitude", "value[:, force] += lost", "value[:, force] -= lost"),
    ("schedule.published", "(3, 2), (-2, 3), (2, 3)", "(3, 2), (-2, 1), (2, 3)"),
    ("schedule.published", "_H, -_H, 0)", "_H, _H, 0)"),
    ("recording.increments", "yield {name: x / dt if", "yield {name: x * dt if"),
    # positions: coarse, fine, setting errors
    ("estimate.accelerometers.coarse", "np.array([1 / a - 1, level @ measured[:, i]])",
     "np.array([1 / a - 1, -level @ measured[:, i]])"),
    ("estimate.accelerometers.coarse", "np.array([1 / a - 1, level", "np.array([a - 1, level"),
    ("estimate.accelerometers.coarse", "measure(angles - corrected)", "measure(angles + corrected)"),
    ("estimate.accelerometers.coarse", "h = measured - (linear.r - linear.J @ x)",
     "h = measured - (linear.r + linear.J @ x)"),
    ("estimate.accelerometers.fine", "x = x + solution.x", "x = x + 2 * solution.x"),
    ("estimate.accelerometers.fine", 'PAIRS = (("yz", "xz")', 'PAIRS = (("xz", "yz")'),
    ("views.local", "white + reached_variance", "white + 2 * reached_variance"),
    ("views.local", "share = np.where(s > 0, 1 /", "share = np.where(s > 0, -1 /"),
    ("views.known_attitude", "angle = s.readout + e[visit]", "angle = s.readout - e[visit]"),
    # static run
    ("estimate.static_run.combined_coefficients", "gain = P @ (H /", "gain = 2 * P @ (H /"),
    ("estimate.static_run.combined_coefficients", '"gimbal_zero:inner": {"phi_0": S}',
     '"gimbal_zero:inner": {"phi_0": -S}'),
    ("estimate.static_run.combined_coefficients", "whiten @ G, whiten @ value", "whiten @ G, -whiten @ value"),
    ("inference.harmonics", "[np.sin(k * angle), np.cos(k * angle)]", "[np.cos(k * angle), np.sin(k * angle)]"),
    ("inference.coloured", "beta = covariance @ (A.T @ B[:, q:])", "beta = covariance @ (A.T @ B[:, q:]) / 2"),
    ("inference.information", "inverse * coefficients", "inverse**2 * coefficients"),
    # turns in place: alignment, error model, filter, iteration
    ("estimate.systematic.alignment", "exponential(earth * t[:, None])", "exponential(-earth * t[:, None])"),
    ("estimate.systematic.alignment", "turn = exponential(-tilt) @ turn", "turn = exponential(tilt) @ turn"),
    ("estimate.systematic.alignment", "np.stack([north, np.cross(down, north), down])",
     "np.stack([north, np.cross(north, down), down])"),
    ("estimate.systematic.alignment", "np.swapaxes(at, -1, -2)], axis=2", "at], axis=2"),
    ("estimate.systematic.alignment", "down = -at[0] @", "down = at[0] @"),
    ("estimate.systematic.error_model", "F[:, 3:6, :3] += cross", "F[:, 3:6, :3] -= cross"),
    ("estimate.systematic.error_model", "np.asarray(exponential(-phi) @ C)", "np.asarray(exponential(phi) @ C)"),
    ("estimate.systematic.error_model", "d[at:end, 3:6], d[at:end, 6:] = motion.velocity",
     "d[at:end, 3:6], d[at:end, 6:] = -motion.velocity"),
    ("estimate.systematic.error_model", "[0.0, 0.0, -segments.rows.site.gravity]",
     "[0.0, 0.0, segments.rows.site.gravity]"),
    ("estimate.systematic.filter_pass", "rotation_vector(start.C_bn @ C[0].T)", "rotation_vector(C[0] @ start.C_bn.T)"),
    ("estimate.systematic.filter_pass", "d=model.d + model.Psi @ constants", "d=model.d - model.Psi @ constants"),
    ("estimate.systematic.filter_pass", "s**2 - WIDE_PRIOR_SIGMAS**-2", "s**2 + WIDE_PRIOR_SIGMAS**-2"),
    ("estimate.systematic.iterate", "step = share * last.regularised_step", "step = -share * last.regularised_step"),
    ("estimate.systematic.error_model", "np.subtract(y, step, out=step)", "np.subtract(step, y, out=step)"),
    ("estimate.systematic.calibrate", "wanted, m.prior_mean + solution.x)", "wanted, m.prior_mean - solution.x)"),
    ("estimate.systematic.calibrate", "from operator import add", "from operator import sub as add"),
    ("navigate.strapdown_unit", "np.add.reduceat(x * dt, begin) / length", "np.add.reduceat(x, begin) / length"),
    # gyroscopes
    ("estimate.gyroscopes.revolutions", "apply_matrix(turns @ C, before)",
     "apply_matrix(np.swapaxes(turns, -1, -2) @ C, before)"),
    ("estimate.gyroscopes.revolutions", "exponential((w - C @ earth) * dt) @ C",
     "exponential((w + C @ earth) * dt) @ C"),
    ("estimate.gyroscopes.revolutions", "rate_matrix(s, beta) @ triad_rotation(x[n:])",
     "rate_matrix(s, beta) @ triad_rotation(x[n:]).T"),
    ("estimate.gyroscopes.revolutions", "S[0] -= ((projected", "S[0] += ((projected"),
    ("estimate.pulses.whole_turns", "K0**2 / speed, one", "K0**2 * speed, one"),
    ("estimate.pulses.gravity_norm", "K0**3 / gravity**2", "K0**3 / gravity"),
    # navigation
    ("navigate.strapdown", "v1[2] += loop[2] * off * h", "v1[2] -= loop[2] * off * h"),
    ("navigate.space_stable_navigator", "1 / aids.height_s**2 - upwards", "-1 / aids.height_s**2 - upwards"),
    ("navigate.space_stable_navigator", "EARTH_RATE * np.array([-r[1], r[0], 0.0])",
     "EARTH_RATE * np.array([r[1], -r[0], 0.0])"),
    ("navigate.static_run", "error[:, 4:] = -navigator", "error[:, 4:] = navigator"),
    ("navigate.static_run", "output.phase - site.phase - EARTH_RATE", "output.phase - site.phase + EARTH_RATE"),
    ("rotation", "np.linalg.svd(b.T @ a)", "np.linalg.svd(a.T @ b)"),
    ("navigate.strapdown_unit", "C = exponential(-phi) @ C", "C = exponential(phi) @ C"),
    ("navigate.static_run", "site.latitude + L, site.phase", "site.latitude - L, site.phase"),
    ("navigate.error_growth", "p[1] * RN * cL, place[4]", "p[1] * RN / cL, place[4]"),
    # uncertainty and budget
    ("navigate.uncertainty", "error(x + root @", "error(x + root.T @"),
    ("navigate.static_run", "(N + site.height) * np.cos(site.latitude) * error", "(N + site.height) * error"),
    ("design.budget", "each = (DP**2).sum(axis=1) / np.maximum(np.diag(P)",
     "each = (DP**2).sum(axis=1) * np.maximum(np.diag(P)"),
))  # fmt: skip


class Replaced(MetaPathFinder):
    """Imports one module with a piece of its text replaced."""

    def __init__(self, error: Error) -> None:
        self.error, self.name = error, f"{PACKAGE}.{error.module}"

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path, target)
        if fullname == self.name and spec is not None and spec.origin is not None:
            spec.loader = _Loader(fullname, spec.origin, self.error)
        return spec if fullname == self.name else None


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, error: Error) -> None:
        super().__init__(name, path)
        self.error = error

    def get_code(self, fullname: str) -> Any:
        text = Path(self.path).read_text("utf-8").replace(self.error.before, self.error.after)
        return compile(text, self.path, "exec")


def text_of(module: str) -> str:
    """Return the text of a module of the package."""
    root = ROOT / PACKAGE
    return root.joinpath(*module.split(".")).with_suffix(".py").read_text("utf-8")


def outdated(errors: Sequence[Error] = ERRORS) -> list[Error]:
    """Return the errors whose text no longer stands in its module exactly once."""
    return [e for e in errors if text_of(e.module).count(e.before) != 1]


def comparisons() -> list[Comparable]:
    """Return every comparison of the derivations with the package, each once."""
    from derivations import __main__  # noqa: F401  all papers register
    from derivations.comparison import CHECKS

    return list(dict.fromkeys(place for places in CHECKS.values() for place in places))


def run(errors: Sequence[Error] = ERRORS) -> Iterator[tuple[Error, str]]:
    """Yield each error with the place whose comparison differs, "" where none does.

    Raises RuntimeError where the package differs without any error.
    """
    from derivations.comparison import forget

    every = comparisons()
    if place := _first_difference(every):  # and what is derived is known from here on
        raise RuntimeError(f"the package differs from the derivations without any error, in {place}")
    forget()
    seconds = {one: _seconds(one) for one in every}
    forget()
    every.sort(key=lambda one: seconds[one])  # what ends soonest first
    for error in errors:
        own_first = sorted(every, key=lambda one: not one[0].startswith(error.module))
        yield error, _in_process(error, own_first, sum(seconds.values()))


def _seconds(one: Comparable) -> float:
    began = time.process_time()
    _first_difference([one])
    return time.process_time() - began


def _first_difference(every: Sequence[Comparable]) -> str:
    from derivations.comparison import _run

    return next((place for place, check in every if not _run(place, check).same), "")


def _in_process(error: Error, every: Sequence[Comparable], seconds: float) -> str:
    """Return the place that differs, found by a copy of this process with the error in the package."""
    read, write = os.pipe()
    pid = os.fork()
    if not pid:
        os.close(read)
        limit = math.ceil(TIMES * seconds + time.process_time())
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        for name in [n for n in sys.modules if n == PACKAGE or n.startswith(f"{PACKAGE}.")]:
            del sys.modules[name]
        sys.meta_path.insert(0, Replaced(error))
        try:
            place = _first_difference(every)
        except BaseException as problem:  # noqa: BLE001  whatever breaks is noticed
            place = f"({type(problem).__name__})"
        os.write(write, place.encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        place = pipe.read()
    _, status = os.waitpid(pid, 0)
    return place if os.waitstatus_to_exitcode(status) == 0 else "(no end)"


def main(words: Sequence[str]) -> int:
    """Print what becomes of each error; return the exit status."""
    errors = [e for e in ERRORS if not words or any(w in str(e) for w in words)]
    if old := outdated(errors):
        sys.stdout.write("".join(f"outdated: {e}\n" for e in old))
        return OUTDATED
    undetected = 0
    for error, place in run(errors):
        undetected += not place
        sys.stdout.write(f"{place or 'UNDETECTED':60} {error}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{len(errors)} errors, {undetected} undetected\n")
    return int(undetected > MOST_UNDETECTED)


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_DISABLE_JIT", "1")
    sys.exit(main(sys.argv[1:]))
