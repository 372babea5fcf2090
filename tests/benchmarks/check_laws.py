"""Whether the recordings of `bench_laws` are what they are said to be; nothing is diagnosed.

    python -m tests.benchmarks.check_laws [--rig RIG] [LAW ...]

Of each law: the sigmas of the recording where 30 are asked for; of the second recording without and with the law, its
size fitted to the first by least squares; and the other variable of which a smooth function (a cubic spline of eight
pieces, alone and times the forces and rates of the law) takes most of it up, with the sigmas that this one leaves and
those that a spline in the law's own variable leaves. A law whose size takes away what it adds to a second recording is
determined as a form; one of which another variable leaves nothing is not determined as a law of its variable.
"""

import argparse
from zlib import crc32

import numpy as np
from scipy.interpolate import BSpline

from gimbalcal.number import Array
from gimbalcal.recording import Recording
from tests.benchmarks.collecting import say
from tests.benchmarks.law_plants import RIGS, SECOND, Hidden, excess, simulated, size_of, variables
from tests.benchmarks.law_set import EVERY_LAW

SIGMAS, PIECES = 30.0, 8


def spline(x: Array) -> Array:
    """Columns (n, 11) of a cubic spline between the extremes of x (n,)."""
    low, high = float(x.min()), float(x.max())
    if high - low < 1e-9:
        return np.ones((len(x), 1))
    knots = np.linspace(low, high, PIECES + 1)
    return np.asarray(BSpline.design_matrix(x, np.r_[[low] * 3, knots, [high] * 3], 3).toarray())


def fitted(seed: int, law: Hidden, size: float, clean: Recording) -> tuple[float, float]:
    """Sigmas, and the share of its size by least squares, the calibration fitted anew.

    Chi squared is a parabola over what is taken away of the law.
    """
    a = (0.0, 0.5, 2.0)
    left = [excess(simulated(seed, law, size * (1 - x)), clean) for x in a]
    p = np.polyfit(a, np.square(left), 2)
    return left[0], float(-p[1] / (2 * p[0]))


def rivals(law: Hidden, r: Recording, clean: Recording) -> dict[str, float]:
    """Sigmas of the law that a spline in each variable leaves, what a calibration takes up taken from both."""
    x = {k: v for k, v in variables(clean).items() if np.ptp(v) > 0}
    added = {k: r.channels[k] - v for k, v in clean.channels.items() if k[0] not in ("true_angle", "temperature")}
    d = max(added.values(), key=lambda v: float(np.std(v)))
    one = np.ones(len(d))
    known = [one, *(v for k, v in x.items() if k.startswith(("force", "rate")) and k.count("_") == 1)]
    if law.rig == "mount":
        az, el = x["azimuth"], x["elevation"]
        known += [f(az) * g(el) for f in (np.sin, np.cos) for g in (np.tan, np.ones_like)]
        known += [np.tan(el), 1 / np.cos(el), np.cos(el)]
    factors = [one, *(x[v] for v in sorted(set(law.follows.replace("|", " ").split())) if v in x and "_" in v)]
    known = [*known, np.gradient(x["table"], x["time"])] if "table" in x else known
    at_rest = law.rig in ("hand", "rotation") and law.where in tuple("xyz")
    steady = clean.position > 0 if at_rest else one > 0

    def left(columns: list[Array]) -> float:
        Z = np.column_stack(columns)[steady]
        return float(np.linalg.norm(d[steady] - Z @ np.linalg.lstsq(Z, d[steady], rcond=1e-9)[0]))

    whole = left(known)
    return {k: SIGMAS * left([*known, *(c * f for c in spline(v).T for f in factors)]) / whole for k, v in x.items()}


def checked(name: str, law: Hidden) -> str:
    """One line of the table."""
    seed = crc32(name.encode()) % 900
    size = size_of(seed, law, SIGMAS)
    first, clean = simulated(seed, law, size), simulated(seed, law, 0.0)
    again = simulated(seed + SECOND, law, 0.0)
    stands, share = fitted(seed, law, size, clean)
    without = excess(simulated(seed + SECOND, law, size), again)
    with_ = excess(simulated(seed + SECOND, law, size * (1 - share)), again)
    left = rivals(law, first, clean)
    own = set(law.follows.replace("|", " ").split())
    own |= {"time", "time_of_day"} if own & {"time", "time_of_day"} else set()
    other = min((x for k, x in left.items() if k not in own), default=np.nan)
    best = min((k for k in left if k not in own), key=left.__getitem__, default="none")
    mine = min((x for k, x in left.items() if k in own), default=np.nan)
    return (f"  {law.rig:10} {name:36} {'determined' if law.determined else 'not determined':14} "
            f"{stands:6.1f} {share:6.2f} {without:6.1f} {with_:5.1f}  {mine:5.1f}  {other:5.1f} {best}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("laws", nargs="*", metavar="LAW", help="its name or the beginning of it")
    parser.add_argument("--rig", choices=RIGS)
    wanted = parser.parse_args()
    say(f"  {'':62} sigmas  fitted   second, with it   own  another variable")
    for name, law in EVERY_LAW.items():
        if wanted.rig in (None, law.rig) and name.startswith(tuple(wanted.laws) or ""):
            say(checked(name, law))


if __name__ == "__main__":
    main()
