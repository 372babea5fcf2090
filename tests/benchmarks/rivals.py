"""The usual ways to find missing terms, on the same recordings and the same columns as the diagnosis.

LASSO by cross-validation (own coordinate descent, as scikit-learn: 50 penalties down to 1e-2 of the largest, 5
blocked folds), forward stepwise regression by BIC, and sequentially thresholded least squares as in PySINDy (ridge
0.05, at most 20 rounds). Each twice: `whitened`, on the columns and data of the diagnosis, whitened by the stated noise
with the calibration profiled out, columns of unit length, variance known, threshold sqrt(2 ln P) sigmas; and `default`,
as people use it: residuals of the finished calibration, columns per prior sigma, published settings (threshold 0.1).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from gimbalcal.diagnose.evidence import projection as evidence
from gimbalcal.diagnose.evidence.projection import Projection
from gimbalcal.diagnose.evidence.stated_noise import noise_grid, nominal_noise, scale_to_scatter
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search import ranking as search
from gimbalcal.diagnose.search import refine
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.estimate.accelerometers.joint import joint
from gimbalcal.estimate.accelerometers.position_outliers import trusted_positions
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.law_plants import Law
from tests.diagnose.plant import record

PENALTIES, SMALLEST, FOLDS, SWEEPS, TOLERANCE = 50, 1e-2, 5, 300, 1e-4
RIDGE, THRESHOLD, ROUNDS = 0.05, 0.1, 20
MOST_TERMS = 60


@dataclass(frozen=True)
class Problem:
    """Columns A (n, P) with the cause each stands for, and data y (n,)."""

    A: Array
    y: Array
    names: tuple[str, ...]
    whitened: bool


def problems(recording: Recording) -> tuple[Problem, Problem]:
    """The same library twice: whitened and profiled, and as residuals of a finished calibration."""
    o = scale_to_scatter(fit_baseline(view_at_known_attitude(recording)))
    found = assemble_library(o)
    names: dict[int, str] = {}
    for c in found.candidates:
        if not c.rival and "," not in c.axis:
            names |= {i: c.label for v in c.variants for i in v.index}
    for c in found.candidates:
        if not c.rival:  # what only acts on all axes together
            names = {i: c.label for v in c.variants for i in v.index} | names
    index = sorted(names)
    node, X = nominal_noise(o), found.X[:, index]
    labels = tuple(names[i] for i in index)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    W, y = node.whiten(X), node.whiten(o.reduced(o.residual[:, :, None]))[:, 0]
    left = W - Q @ (Q.T @ W)
    size = np.sqrt((left**2).sum(axis=0))
    kept = np.flatnonzero(size > 1e-3 * np.sqrt((W**2).sum(axis=0)) + 1e-12)
    profiled = Problem(left[:, kept] / size[kept], y - Q @ (Q.T @ y), tuple(labels[i] for i in kept), True)
    R = orthonormal(o.reduced(o.Z))
    plain = o.reduced(o.residual[:, :, None])[:, 0]
    return profiled, Problem(X, plain - R @ (R.T @ plain), labels, False)


def stlsq(p: Problem) -> Array:
    """Coefficients (P,) of sequentially thresholded ridge regression."""
    threshold = np.sqrt(2 * np.log(p.A.shape[1])) if p.whitened else THRESHOLD
    on = np.ones(p.A.shape[1], dtype=bool)
    for _ in range(ROUNDS):
        A = p.A[:, on]
        w = np.zeros(len(on))
        w[on] = np.linalg.solve(A.T @ A + RIDGE * np.eye(A.shape[1]), A.T @ p.y)
        kept = np.abs(w) >= threshold
        if np.array_equal(kept, on):
            break
        on = kept
        if not on.any():
            return np.zeros(len(on))
    return _refitted(p, np.flatnonzero(on))


def stepwise(p: Problem) -> Array:
    """Coefficients (P,) of forward selection while BIC falls."""
    G, b, rss, n = p.A.T @ p.A, p.A.T @ p.y, float(p.y @ p.y), len(p.y)
    floor = 1e-6 * np.diag(G)
    chosen: list[int] = []
    for _ in range(MOST_TERMS):
        d = np.diag(G)
        gain = np.where(d > floor, b**2 / np.maximum(d, 1e-300), 0.0)
        j = int(np.argmax(gain))
        better = gain[j] if p.whitened else n * np.log(rss / (rss - gain[j]))
        if better < np.log(n):
            break
        chosen.append(j)
        rss -= float(gain[j])
        g = G[:, j] / G[j, j]
        b, G = b - g * b[j], G - np.outer(g, G[j])
    return _refitted(p, np.array(chosen, dtype=int))


def _refitted(p: Problem, index: Array) -> Array:
    w = np.zeros(p.A.shape[1])
    if len(index):
        w[index] = np.linalg.lstsq(p.A[:, index], p.y, rcond=1e-8)[0]
    return w


def lasso(p: Problem) -> Array:
    """Coefficients (P,) at the penalty with the least error over the folds."""
    y = p.y if p.whitened else p.y - p.y.mean()
    A = p.A if p.whitened else p.A - p.A.mean(axis=0)
    top = float(np.abs(A.T @ y).max())
    penalties = top * np.geomspace(1, SMALLEST, PENALTIES)
    error = np.zeros(PENALTIES)
    for held in np.array_split(np.arange(len(y)), FOLDS):
        kept = np.setdiff1d(np.arange(len(y)), held)
        path = lasso_path(A[kept], y[kept], penalties * len(kept) / len(y))
        error += ((y[held, None] - A[held] @ path) ** 2).sum(axis=0)
    best = int(np.argmin(error))
    return lasso_path(A, y, penalties[: best + 1])[:, -1]


def lasso_path(A: Array, y: Array, penalties: Array) -> Array:
    """Minimisers (P, penalties) of half the squares plus penalty times the sum of sizes, each from the one before."""
    return np.asarray(_descend()(A.T @ A, A.T @ y, penalties, float(y @ y)))


def _descend() -> Callable[..., Array]:
    """Coordinate descent, compiled where numba is installed; without it the same numbers take some times as long."""
    if not _COMPILED:
        try:
            from numba import njit
        except ImportError:
            _COMPILED.append(_coordinate_descent)
        else:
            _COMPILED.append(njit(_coordinate_descent))
        _COMPILED[0](np.eye(2), np.ones(2), np.array([0.5]), 2.0)
    return _COMPILED[0]


_COMPILED: list[Callable[..., Array]] = []


def _coordinate_descent(G: Array, b: Array, penalties: Array, yy: float) -> Array:
    P = len(b)
    w, r = np.zeros(P), b.copy()  # r = A^T (y - A w)
    out = np.zeros((P, len(penalties)))
    for k in range(len(penalties)):
        for sweep in range(SWEEPS):
            change = largest = 0.0
            for j in range(P):
                if G[j, j] <= 0.0 or (sweep % 10 and w[j] == 0.0):  # mostly among those that are in
                    continue
                z = r[j] + G[j, j] * w[j]
                new = np.sign(z) * max(abs(z) - penalties[k], 0.0) / G[j, j]
                d = new - w[j]
                if d != 0.0:
                    r -= G[:, j] * d
                    w[j] = new
                    change = max(change, abs(d) * np.sqrt(G[j, j]))
                largest = max(largest, abs(w[j]) * np.sqrt(G[j, j]))
            if sweep % 10 == 0 and change <= TOLERANCE * max(largest, 1e-3 * np.sqrt(yy)):
                break
        out[:, k] = w
    return out


METHODS: dict[str, Callable[[Problem], Array]] = {"LASSO-CV": lasso, "stepwise BIC": stepwise, "STLSQ": stlsq}


def compare(recording: Recording, found: Sequence[Law]) -> dict[str, Any]:
    """What each rival says of a recording, whether its largest cause is right, and its time."""
    _descend()
    with threadpool_limits(limits=1):
        begin = process_time()
        both = problems(recording)
        out: dict[str, Any] = {"preparation": process_time() - begin}
        for p in both:
            for name, method in METHODS.items():
                begin = process_time()
                w = method(p)
                seconds = process_time() - begin
                out[f"{name}, {'whitened' if p.whitened else 'default'}"] = {**_said(p, w, found), "seconds": seconds}
    return out


def _said(p: Problem, w: Array, found: Sequence[Law]) -> dict[str, Any]:
    names = np.array(p.names)
    on = np.flatnonzero(w)
    named = list(dict.fromkeys(names[on].tolist()))
    sizes = [float(np.linalg.norm(p.A[:, names == n] @ w[names == n])) for n in named]
    top = named[int(np.argmax(sizes))] if named else ""
    fitted = float(p.y @ p.y - ((p.y - p.A @ _refitted(p, on)) ** 2).sum())
    return {
        "named": len(named), "top": top, "right": any(_is(top, law) for law in found),
        "score": fitted - len(on) * float(np.log(len(p.y))) if named else -1e9,
    }  # fmt: skip


def _is(label: str, law: Law) -> bool:
    effect, _, axis = label.partition(":")
    return effect in law.ids and (not law.axis or law.axis in axis)


def rivals_table(rows: Sequence[dict[str, Any]], say: Callable[[str], None]) -> None:
    """Every method on the same recordings: false alarms, right causes, and time."""
    mine = [r for r in rows if r.get("rivals")]
    clean = [r for r in mine if r["arm"] == "clean"]
    full = [r for r in mine if r["arm"] == "single"]
    if not clean or not full:
        return
    strengths = sorted({r["sigmas"] for r in full})
    n = f"{len(clean)} clean, {len(full)} with one effect"
    say(f"\nrivals on the same recordings ({n}). Right: the largest cause is")
    say("the concealed one; at 1 %: only where the score exceeds what 1 % of the clean recordings reach")
    head = "".join(f"{f'right {s:g} s':>12}{'at 1 %':>8}" for s in strengths)
    say(f"  {'':24}{'false alarms':>14}{head}{'causes named':>14}{'time / ours':>13}")
    ours = float(np.median([r["seconds"] for r in mine]))
    for name in ["diagnose"] + [k for k in mine[0]["rivals"] if k != "preparation"]:
        say(_rival_line(name, clean, full, strengths, ours))
    waiting = float(np.median([r["rivals"]["preparation"] for r in mine]))
    say(f"  time of the rivals holds residuals and columns, which take {waiting / ours:.2f} of a diagnosis")


def _rival_line(name: str, clean: Any, full: Any, strengths: Sequence[float], ours: float) -> str:
    def entry(r: dict[str, Any]) -> dict[str, Any]:
        if name != "diagnose":
            return dict(r["rivals"][name])
        right = bool(r["claims"]) and bool(r["claims"][0][4]) and len(r["claims"]) == 1
        raised = r["verdict"] != "adequate"
        causes = sum(1 + len(c[2]) for c in r["claims"]) if r["claims"] else int(raised)
        return {"named": causes, "right": right, "score": r["ln_bayes"], "seconds": 0.0}

    limit = float(np.quantile([entry(r)["score"] for r in clean], 0.99))
    alarms = np.mean([entry(r)["named"] > 0 for r in clean])
    cells = ""
    for s in strengths:
        part = [entry(r) for r in full if r["sigmas"] == s]
        right = [e["right"] for e in part]
        held = [e["right"] and e["score"] > limit for e in part]
        cells += f"{np.mean(right):12.0%}{np.mean(held):8.0%}"
    named = np.mean([entry(r)["named"] for r in full])
    waiting = [0.0 if name == "diagnose" else r["rivals"]["preparation"] for r in clean + full]
    seconds = [entry(r)["seconds"] + w for r, w in zip(clean + full, waiting, strict=True)]
    ratio = 1.0 if name == "diagnose" else float(np.median(seconds)) / ours
    return f"  {name:24}{alarms:14.0%}{cells}{named:14.1f}{ratio:13.2f}"


def speed(rows: Sequence[dict[str, Any]], say: Callable[[str], None]) -> None:
    """Evidence evaluations per second (one hypothesis in one noise, all sizes), and a diagnosis against a fit."""
    recording = record(np.random.default_rng(1), rows=120)
    counted = [0]

    def counting(p: Projection, index: Array) -> Array:
        ln = _plain(p, index)
        counted[0] += ln.size
        return ln

    _plain = evidence.any_size
    with threadpool_limits(limits=1):
        o = scale_to_scatter(fit_baseline(view_at_known_attitude(recording)))
        found, grid = assemble_library(o), noise_grid(o)
        evidence.any_size = refine.any_size = counting  # type: ignore[attr-defined]
        begin = perf_counter()
        search.search(o, found, grid)
        seconds = perf_counter() - begin
        evidence.any_size = refine.any_size = _plain  # type: ignore[attr-defined]
        fits = []
        for _ in range(5):
            begin = perf_counter()
            joint(trusted_positions(recording))
            fits.append(perf_counter() - begin)
    say(f"\nspeed: {counted[0] / seconds:,.0f} evidence evaluations a second in a search of {seconds:.2f} s")
    ours = float(np.median([r["seconds"] for r in rows if r["arm"] == "clean"] or [np.nan]))
    say(f"one diagnosis of 18 positions: {ours:.2f} s, {ours / float(np.median(fits)):.0f} times one calibration")
