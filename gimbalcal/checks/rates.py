r"""Gyroscopes reversed, exchanged or in another unit, found before anything is estimated.

A calibration would absorb these too, as scale errors of -170000 ppm. So what the gyroscopes say of each turn between
rests is held against what gravity's direction (else the gimbals) did, and against what it would be for another
reading of their columns, rates M w for rates w, M one of `triads.PERMUTATIONS` times a ratio of units:

.. math:: f_2 / |f_2| = C(M w) \, f_1 / |f_1|, \qquad C(M w) = M \, C(\det(M) \, w) \, M^T .

At rest, where the latitude is known and the gyroscopes see the Earth, its rate along the vertical says it again, with
b a bias: :math:`f_k / |f_k| \cdot (M w_k - b) = \Omega \sin L`. Scale errors, biases and misalignments that can be
calibrated are far smaller than what is asked here.

Gravity alone cannot tell a change of the gyroscopes that keeps them right-handed from the inverse change of the
accelerometers, so both are named unless gimbals have vouched for the accelerometers.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.checks.axes import AXES, NEARLY_ALL, PERMUTATIONS, AxisPermutation, in_words, remedy
from gimbalcal.checks.gravity_turns import Turns, agree, down, rotations, turns_of
from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording.completed import with_rests
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import RATE, Recording
from gimbalcal.units import to_si

FEWEST_RESTS = 8  # three of them go into the bias
UNITS = ("rad/s", "deg/s", "deg/h", "mdeg/s", "rad/h")
# seconds that a second of the stated unit really is
CLOCKS = {1e-3: "ms", 1e3: "s instead of ms", 1e-6: "us", 60.0: "min", 3600.0: "h"}
COUNTS = np.geomspace(0.2, 20, 40)  # rad that a median turn may have, where nothing says how much a count is
FACTORS = 1e-2, 1e2, 93  # of all rates, in steps of 10 %
INSTRUMENT = 3.0  # rates off by less are no slip of a unit: a range that was left, rows that were lost
REVERSED = AxisPermutation(signs=(-1, -1, -1))
FAINT = 0.3  # of what no reading at all would leave: gyroscopes see the Earth where less remains
UNCHECKED = (
    "axes, signs and unit of the gyroscopes were not checked: it takes three logged turns between rests that move "
    "gravity, or the Earth's rate at eight rests at a known latitude"
)


def refuse_implausible_rates(recording: Recording) -> tuple[str, ...]:
    """Raise `InputError` where axes, signs or unit of the gyroscopes cannot be right; else what was not checked."""
    if recording.kind.stabilised and recording.has(RATE):
        return ("the gyroscopes of a static run are not looked at",)
    if not (recording.kind.in_positions or recording.kind.rotating) or set(recording.axes(RATE)) != set(AXES):
        return ()
    if recording.kind.rotating:
        recording = with_rests(recording)
    turns = turns_of(recording)
    if turns is not None:
        _check_turns(recording, turns)
    seen = _check_earth(recording, turns is not None)
    if turns is not None or seen:
        return ()
    return (UNCHECKED,)


def turns_explained(recording: Recording) -> tuple[int, int] | None:
    """Turns at which the gyroscopes say where gravity went, and how many could tell; None where none can."""
    if not recording.kind.in_positions or set(recording.axes(RATE)) != set(AXES):
        return None
    turns = turns_of(recording)
    if turns is None:
        return None
    factors = _scales(turns) if recording.counted(RATE) else [(1.0, "")]
    return max(agree(turns, rotations(turns, f * np.ones(3))) for f, _ in factors), len(turns.reading)


def _check_turns(recording: Recording, turns: Turns) -> None:
    """Another reading of the columns that fits nearly every turn, while the stated one does not, is the right one."""
    n = len(turns.reading)
    factors = [(1.0, "")] if not recording.counted(RATE) else _scales(turns)
    stated = max(agree(turns, rotations(turns, f * np.ones(3))) for f, _ in factors)
    if stated >= NEARLY_ALL * n:
        return
    units = [] if recording.counted(RATE) else _units(recording)
    best, words = stated, ""
    alone = [(f, u, PERMUTATIONS[:1]) for f, u in units] + [(f, u, PERMUTATIONS[1:]) for f, u in factors]
    for stage in (alone, [(f, u, PERMUTATIONS[1:]) for f, u in units]):  # one slip before two
        for factor, unit, changes in stage if best < NEARLY_ALL * n else []:
            both = {sign: rotations(turns, sign * factor * np.ones(3)) for sign in (1, -1)}
            for change in changes:
                M = change.matrix
                agreeing = agree(turns, M @ both[change.handed] @ M.T)
                if agreeing > best:
                    best, words = agreeing, _both_in_words(recording, turns, change, unit)
        if best < NEARLY_ALL * n and units and stage is alone:
            _check_factor(recording, turns, stated)
    for factor, unit in units if best < NEARLY_ALL * n else []:
        for few in (f for f in np.ndindex(2, 2, 2) if 0 < sum(f) < 3):
            agreeing = agree(turns, rotations(turns, np.where(few, factor, 1.0)))
            if agreeing > best:
                one = " and ".join(a for a, wrong in zip(AXES, few, strict=True) if wrong)
                best, words = agreeing, f"{unit} in {one} alone"
    if best >= NEARLY_ALL * n and best >= stated + 2:
        by = "gravity" if turns.before.shape[-1] == 1 else "the gimbals"
        raise InputError(
            f"{recording.label}: only {stated} of {n} turns between rests are by {by} what the gyroscopes say, and "
            f"{best} if {words}"
        )


def _check_factor(recording: Recording, turns: Turns, stated: int) -> None:
    """Any other factor of all rates: a unit that nobody thought of."""
    n, guesses = len(turns.reading), np.geomspace(*FACTORS)
    agreeing = np.zeros(len(guesses), dtype=int)
    for i in np.flatnonzero(np.abs(np.log(guesses)) > np.log(INSTRUMENT)):
        agreeing[i] = agree(turns, rotations(turns, guesses[i] * np.ones(3)))
    fits = np.flatnonzero(agreeing >= NEARLY_ALL * n)
    if not len(fits):
        return
    fits = fits[: 1 + int(np.argmax(np.append(np.diff(fits) > 1, True)))]  # larger ones go round once more
    factor = float(np.exp(np.log(guesses[fits]).mean()))
    cure = f"correct the unit of their columns, {recording.units.get((RATE, 'x'), 'rad/s')!r}, or of the time"
    raise InputError(
        f"{recording.label}: only {stated} of {n} turns between rests are by gravity what the gyroscopes say, and "
        f"{max(agreeing[fits])} if every rate were some {factor:.2g} times what it is; {cure}"
    )


def _units(recording: Recording) -> list[tuple[float, str]]:
    """Ratios of other units of rate to the stated one, and of other clocks, with what to write."""
    stated = recording.units.get((RATE, "x"), "rad/s")
    ratios = [(to_si(1.0, u) / to_si(1.0, stated), f'the rates are in {u} (write unit = "{u}")') for u in UNITS]
    clocks = [(f, f"the time is in {u}") for f, u in CLOCKS.items()]
    step = float(np.median(np.diff(recording.time)))
    added = (
        1 / step,
        f'they are what each step of {step:.3g} s adds to the angle (write quantity = "angle_increment")',
    )
    return [(f, words) for f, words in (added, *ratios, *clocks) if abs(f - 1) > 1e-6]


def _scales(turns: Turns) -> list[tuple[float, str]]:
    """Guesses of the rad/s of a count."""
    median = np.median(
        [(np.linalg.norm(w, axis=1) * dt).sum() for w, dt in zip(turns.reading, turns.step, strict=True)]
    )
    return [(float(g), "") for g in COUNTS / median]


def _both_in_words(recording: Recording, turns: Turns, change: AxisPermutation, unit: str) -> str:
    """A change of the gyroscopes and, where gravity alone tells, the same as one of the accelerometers; the cure."""
    told = [(change, "gyroscope")]
    vouched = recording.platform.axes and recording.has("gimbal_angle")
    if change.handed > 0 and not vouched and turns.before.shape[-1] == 1:
        told.append((min((change.inverse(sign) for sign in (1, -1)), key=lambda c: c.slips), "accelerometer"))
    return _cured(told, unit, "; as stated the gyroscopes make a left-handed triad" if change.handed < 0 else "")


def _cured(told: list[tuple[AxisPermutation, str]], unit: str, handed: str = "") -> str:
    """Changes of which one is true, the simplest first, after a change of unit; and what to write for the first."""
    told = sorted((t for t in told if t[0] != PERMUTATIONS[0]), key=lambda t: t[0].slips)
    words = [unit] if unit else []
    if told:
        words.append(", or ".join(in_words(*t) for t in told) + f"{handed}; correct [columns]: {remedy(*told[0])}")
    return " and ".join(words)


# --- the Earth at rest ------------------------------------------------------------------------------------------------


def _check_earth(recording: Recording, turned: bool) -> bool:
    """Whether the gyroscopes see the Earth at rest; raises InputError where another reading sees it instead.

    turned: turns have vouched for the gyroscopes beside the accelerometers, so that only all signs together are open.
    """
    latitude, up = recording.site.latitude, down(recording)
    stays = dwells(recording)
    if latitude is None or up is None or len(stays) < FEWEST_RESTS or recording.counted(RATE):
        return False
    y = recording.triad(RATE)
    rate = np.array([y[d.rows].mean(0) for d in stays])
    up = up[..., 0]
    due = EARTH_RATE * np.sin(latitude)
    Q = np.linalg.qr(up)[0]
    if np.linalg.matrix_rank(up, tol=0.1 * np.sqrt(len(up))) < 3:
        return False

    def left(w: Array) -> float:
        r = np.sum(up * w, axis=1) - due
        return float(np.sqrt(np.mean((r - Q @ (Q.T @ r)) ** 2)))

    nothing, stated = left(0 * rate), left(rate)
    if nothing < 0.5 * abs(due) or stated < FAINT * nothing:
        return bool(nothing >= 0.5 * abs(due))
    units = [(1.0, "")] + ([] if turned else [u for u in _units(recording) if "time" not in u[1]])
    changes = [c for c in PERMUTATIONS if not turned or c == REVERSED]
    found = [(left(f * apply_matrix(c.matrix, rate)), c, unit) for f, unit in units for c in changes]
    best, change, unit = min(found, key=lambda t: t[0])
    if best >= FAINT * nothing:
        return False
    told = [] if turned else [(change, "gyroscope")]
    if not (recording.platform.axes and recording.has("gimbal_angle")):
        told.append((change.inverse(), "accelerometer"))
    south = "the latitude has the opposite sign, or " if change == REVERSED else ""
    hour = 3600 * np.degrees(1.0)
    raise InputError(
        f"{recording.label}: at rest the gyroscopes miss the Earth's rate along the vertical, {due * hour:.4g} "
        f"deg/h, by {stated * hour:.3g} deg/h rms, and by {best * hour:.3g} deg/h if "
        f"{south}{_cured(told, unit)}"
    )
