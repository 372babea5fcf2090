"""Table 4, all 36 parameters of one unit by three methods.

The recordings behind it are not printed, so no value can be derived. What can be is the step from method 2 to method 3,
which has the nonlinear terms: leaving them out moves the nine linear parameters of the accelerometers by what a
least-squares fit of the norm makes of them. Over six faces and all twelve edges between them that is a number, and an
entry agrees when the printed step is that number, its rounding included. (Over nine of the edges, which is what method
3 says it needs, some misalignment would move by much more than is printed: method 2 had other positions.) The
gyroscopes' K_g2 moves the others by less than they are rounded to. A parameter that only one method has is not
determined.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from math import log10, pi
from typing import Any

import numpy as np

from derivations.verdict import AGREES, NOT_DETERMINED, WRONG, Verdict, by_size, last_digit
from derivations.wang2019.accelerometer import faces_and_edges
from derivations.wang2019.symbols import SOURCE

NONE = "-"
# methods 1, 2, 3 as printed; units by name below
ENTRIES: dict[str, tuple[str, str, str]] = {
    "nabla_x": ("-1.23e-2", "-1.23e-2", "-1.21e-2"),
    "nabla_y": ("-1.55e-2", "-1.55e-2", "-1.54e-2"),
    "nabla_z": ("-1.39e-2", "-1.39e-2", "-1.37e-2"),
    "K_a1x": ("2.32e-6", "2.32e-6", "2.32e-6"),
    "K_a1y": ("2.25e-6", "2.25e-6", "2.26e-6"),
    "K_a1z": ("2.18e-6", "2.18e-6", "2.18e-6"),
    "K_a2x": (NONE, NONE, "-1.53e-15"),
    "K_a2y": (NONE, NONE, "-1.12e-15"),
    "K_a2z": (NONE, NONE, "-1.21e-15"),
    "K_a3x": (NONE, NONE, "-5.07e-21"),
    "K_a3y": (NONE, NONE, "-7.80e-21"),
    "K_a3z": (NONE, NONE, "-6.91e-21"),
    "E_ayx": (NONE, "4.24e-4", "4.24e-4"),
    "E_azx": (NONE, "3.21e-4", "3.21e-4"),
    "E_azy": (NONE, "1.74e-4", "1.75e-4"),
    "eps_x": ("-3.44e-6", "-3.44e-6", "-3.45e-6"),
    "eps_y": ("2.04e-6", "2.04e-6", "2.04e-6"),
    "eps_z": ("-6.71e-9", "-6.71e-9", "-6.70e-9"),
    "K_g1x": ("5.08e-7", "5.08e-7", "5.09e-7"),
    "K_g1y": ("5.10e-7", "5.10e-7", "5.10e-7"),
    "K_g1z": ("5.08e-7", "5.08e-7", "5.09e-7"),
    "K_g2x": (NONE, NONE, "-6.35e-18"),
    "K_g2y": (NONE, NONE, "9.00e-18"),
    "K_g2z": (NONE, NONE, "-9.97e-18"),
    "E_gyx": (NONE, "3.58e-4", "3.58e-4"),
    "E_gzx": (NONE, "13.29e-4", "13.30e-4"),
    "E_gzy": (NONE, "-2.09e-4", "-2.09e-4"),
    "alpha_1": (NONE, "-14.72e0", "-14.72e0"),
    "beta_1": (NONE, "0.0039e0", "0.0039e0"),
    "gamma_1": (NONE, "-4.84e0", "-4.84e0"),
    "alpha_2": ("-7.48e0", NONE, NONE),
    "beta_2": ("-0.69e0", NONE, NONE),
    "gamma_2": ("-7.36e0", NONE, NONE),
    "alpha_3": ("5.97e0", NONE, NONE),
    "beta_3": ("-0.026e0", NONE, NONE),
    "gamma_3": ("-3.77e0", NONE, NONE),
}
# fmt: off
UNITS = {"nabla": "g", "K_a1": "g/pulse", "K_a2": "g/pulse^2", "K_a3": "g/pulse^3", "K_g1": "deg/s/pulse",
         "K_g2": "deg/s/pulse^2", "eps": "deg/s", "E_": "", **dict.fromkeys(("alpha", "beta", "gamma"), "arcmin")}
# fmt: on
LINEAR = (*(f"K_a1{a}" for a in "xyz"), *(f"nabla_{a}" for a in "xyz"), "E_ayx", "E_azx", "E_azy")
EARTH = 15.04107 / 3600  # deg/s
DRIFT_OF_A_NAVIGATOR = 0.01 / 3600  # deg/s: the precision that section 5.2 states
ARCMIN = pi / 10800


def value(name: str, method: int = 3) -> float:
    return float(ENTRIES[name][method - 1])


def unit(name: str) -> str:
    return next(u for start, u in UNITS.items() if name.startswith(start))


def _step(edges: Any) -> Any:
    """Return (9,) step method 2 less method 3 of the linear accelerometer parameters over the faces and some edges.

    Along an axis the terms left out are q2 u^2 + q3 u^3 in g, u the share of gravity there; the fit of the norm makes
    of sum u_i (q2 u_i^2 + q3 u_i^3) what relative scale (u_i^2), bias (u_i) and leaning (u_i u_j) can.
    """
    K1, K2, K3 = (np.array([value(f"K_a{n}{a}") for a in "xyz"]) for n in (1, 2, 3))
    u = np.concatenate([faces_and_edges()[0], edges])
    x, y, z = u.T
    J = np.column_stack([u**2, u, y * x, z * x, z * y])
    left_out = (K2 / K1**2 * u**3 + K3 / K1**3 * u**4).sum(1)
    return np.linalg.lstsq(J, left_out, rcond=1e-9)[0] * np.r_[K1, np.ones(6)]


@cache
def steps() -> dict[str, float]:
    """Return the step of each parameter over six faces and twelve edges."""
    return dict(zip(LINEAR, _step(faces_and_edges()[1]), strict=True))


@cache
def least_leaning() -> float:
    """Return the least, over all choices of nine edges, of the largest step of a misalignment."""
    edges = faces_and_edges()[1]
    return min(float(np.abs(_step(edges[list(nine)])[6:]).max()) for nine in combinations(range(12), 9))


def gyroscope_step(name: str) -> float:
    """Return the bound of the step that leaving K_g2 out makes: K2 N^2 of the Earth's rate at rest, 2 K2 w_e / K1^2 in
    (30).
    """
    K1, K2 = value("K_g1x"), max(abs(value(f"K_g2{a}")) for a in "xyz")
    if name.startswith("eps"):
        return K2 * (EARTH / K1) ** 2
    relative = 2 * K2 * EARTH / K1**2
    return relative * (value(name) if name.startswith("K_g1") else 1.0)


def judge_step(name: str) -> Verdict:
    """Judge whether the step from method 2 to method 3 is what the terms left out make."""
    printed, rounding = value(name, 2) - value(name, 3), last_digit(ENTRIES[name][2])  # half a unit of each of the two
    of = f" {unit(name)}".rstrip()
    derived, bound = (steps()[name], 0.0) if name in LINEAR else (0.0, gyroscope_step(name))
    off = abs(printed - derived) - bound
    gap = max(off - 1.001 * rounding, 0.0)
    # both values on the edge of what rounds to them, in opposite senses: nothing but coincidence would do it
    edge = gap == 0 and off > 0.9 * rounding
    if name in LINEAR:
        step = f"step {derived if abs(derived) > 1e-12 else 0:.2g}{of}"
        effect = f"Over six faces and twelve edges leaving K_a2 and K_a3 out makes a {step}"
    else:
        step = f"step within {bound:.1g}{of}"
        effect = f"Leaving K_g2 out makes a {step}"
    why = (
        f"{effect}, rounding adds up to {rounding:.0e}, and the printed step is {printed:.2g}"
        f"{'' if gap == 0 else ', which does not follow'}. The value itself rests on recordings that are not printed."
    )
    verdict = NOT_DETERMINED if edge else AGREES if gap == 0 else WRONG
    size = f"{off:.1g}{of}" if edge else "0" if gap == 0 else f"{gap:.1g}{of}"
    if edge:
        why += " Rounding would explain it only where both values lie at the edge of what rounds to them."
    return Verdict(SOURCE, f"Table 4, {name}", verdict, _printed(name), step, size, why + _more(name),
                   assumes="six faces and twelve edges" if name in LINEAR else "")  # fmt: skip


def _more(name: str) -> str:
    """Return what the digits of an entry say beyond its step."""
    if name.startswith("E_a"):
        return (
            f" Over any nine of the edges some misalignment would move by {least_leaning():.0e} or more: method 2 was "
            "not fitted to fifteen such positions."
        )
    if name != "eps_z":
        return ""
    return (
        " Table 3's RMS of it is 2e-9 deg/s, a third of the value; that three methods on two turntables agree to 1e-11 "
        "would be chance if their rests were separate recordings."
    )


def _printed(name: str) -> str:
    shown = ", ".join(v.replace("e0", "") for v in ENTRIES[name])
    return f"{shown} {unit(name)}".rstrip()


def judge_alone(name: str) -> Verdict:
    """Judge a parameter that one method has: its size, and that only the recordings could say more."""
    derived, size, words = _size(name)
    why = f"It needs the recordings, which are not printed. {words}"
    return Verdict(SOURCE, f"Table 4, {name}", NOT_DETERMINED, _printed(name), derived, size, why)


def _size(name: str) -> tuple[str, str, str]:
    axis = name[-1]
    if name.startswith("K_a"):
        n = int(name[3])
        at = value(name) / value(f"K_a1{axis}") ** n
        drawn = {2: 5e-15, 3: 5e-21}[n]
        side = "inside" if abs(value(name)) <= drawn else "outside"
        return (
            f"{at:.1e} g at 1 g",
            f"{abs(at) * 1e6:.0f} ug",
            f"It is {at * 1e6:.0f} ug at 1 g, {side} Table 2's range.",
        )
    if name.startswith("K_g2"):
        at = value(name) * (10 / value(f"K_g1{axis}")) ** 2
        return (f"{at:.1e} deg/s at 10 deg/s", f"{abs(at) * 3600:.0f} deg/h",
                f"At 10 deg/s it is {at * 3600:.1f} deg/h; see Tables 4 and 5, K_g2.")  # fmt: skip
    words = "It holds how the unit stood on the turntable; see alpha_1 to gamma_1 for what its sums must be."
    return "an angle of the mounting", "not quantified", words


def judge_angle(name: str) -> Verdict:
    """Judge the inter-triad angle of method 3 against that which method 1's two rotations give."""
    letter = name.removesuffix("_1")
    a, g, three = value(f"{letter}_2", 1), value(f"{letter}_3", 1), value(name)
    lean = [value(e) for e in ("E_ayx", "E_azx", "E_azy", "E_gyx", "E_gzx", "E_gzy")]
    bound_arcmin = sum(map(abs, lean)) / ARCMIN  # what triangles left out of Eqs. (44) and (45) can move
    difference = three - (a - g)
    why = (
        "It needs the recordings, which are not printed. Methods 2 and 3 agree, as they must: nothing nonlinear turns "
        f"a triad. C_p^q of Eq. (43) should be the product of Eq. (45), inverted, and Eq. (44): {a - g:.2f} arcmin, "
        f"{abs(difference):.2f} from the printed one. The triangles that (44) and (45) leave out can move it by up to "
        f"{bound_arcmin:.1f} arcmin, so the table neither confirms nor contradicts itself here."
    )
    range_ = f"{a - g:.2f} arcmin within {bound_arcmin:.1f}"
    return Verdict(SOURCE, f"Table 4, {name}", NOT_DETERMINED, _printed(name), range_,
                   f"{abs(difference):.2g} arcmin", why)  # fmt: skip


def judge_swing() -> Verdict:
    """Judge Table 4's second order of the gyroscopes under Table 5's swing."""
    K1, K2 = value("K_g1x"), abs(value("K_g2x"))  # the smallest of the three K_g2
    frequency, amplitude = 8.0, 5.0  # Hz, deg: roll
    peak = 2 * pi * frequency * amplitude
    mean = K2 / K1**2 * peak**2 / 2
    return Verdict(
        SOURCE, "Tables 4 and 5, K_g2", by_size(mean, DRIFT_OF_A_NAVIGATOR, 10 * DRIFT_OF_A_NAVIGATOR),
        "K_g2x -6.35e-18 deg/s/pulse^2; roll 8 Hz, 5 deg",
        f"mean rate {mean:.2f} deg/s where it is left out", f"{mean:.2f} deg/s",
        f"A square does not average out: 5 deg at 8 Hz peaks at {peak:.0f} deg/s, and the smallest K_g2 of Table 4 "
        f"makes {mean:.2f} deg/s of mean drift of it for a navigator that leaves it out. No position would survive a "
        "minute of that, while Figure 10 shows 18 % less error. One of three does not hold: the swing, K_g2, or that "
        "pulses are per second.",
    )  # fmt: skip


def judge_ranges() -> Verdict:
    """Judge the sentence that the ranges of Table 2 are set based on the unit of Table 4."""
    limits: dict[str, float] = {"nabla": 1e-2, "K_a2": 5e-15, "K_a3": 5e-21, "E_a": 5e-4}
    outside = [n for n in ENTRIES for start, most in limits.items() if n.startswith(start) and abs(value_of(n)) > most]
    worst = max(abs(value_of(n)) / most for n in outside for start, most in limits.items() if n.startswith(start))
    return Verdict(
        SOURCE, "Section 5.1, ranges", by_size(log10(worst), 0.0, 1.0),
        "the distribution of all parameters shown in Table 2 are set based on the IMU parameters in real experiments",
        f"{len(outside)} of 15 accelerometer parameters of Table 4 outside", f"factor {worst:.2g}",
        f"By order of magnitude: {', '.join(outside)} of the real unit lie outside the ranges drawn from, by up to a "
        f"factor of {worst:.2g}.",
    )  # fmt: skip


def value_of(name: str) -> float:
    """Return what the last method that has a parameter prints."""
    return float(next(v for v in reversed(ENTRIES[name]) if v != NONE))


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on all 36 entries, and what follows from them elsewhere."""
    out = []
    for name, (_, two, three) in ENTRIES.items():
        angle = name in ("alpha_1", "beta_1", "gamma_1")
        judged: Any = judge_angle if angle else judge_alone if NONE in (two, three) else judge_step
        out.append(judged(name))
    return (*out, judge_swing(), judge_ranges())
