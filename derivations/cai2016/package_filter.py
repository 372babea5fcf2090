"""The package's systematic calibration against the filter of the derivation: sensor columns, states, blocks, smoother.

Nothing is derived here. What is shared with other papers stands in `derivations.navigator`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from derivations import navigator
from derivations.cai2016 import error_model
from derivations.cai2016.package import ACC_FIELDS, GYRO_FIELDS, derived_slopes
from derivations.cai2016.symbols import ALPHA, GAMMA, SOURCE, r
from derivations.comparison import checks, once
from derivations.readings import FORCE, RATE
from gimbalcal.recording.kinds import ROTATION

SENSITIVITY = "estimate.systematic.error_model.sensitivity"
BLOCKS = ((1, 1), (1, 2), (1, 3), (2, 1), (2, 2), (2, 3), (3, 2), (3, 3))
COLUMNS = {
    "gyro_scale_factor": "F14", "gyro_bias": "F14", "gyro_misalignment": "F14", "gyro_g_sensitivity_rate": "F16",
    "scale_factor": "F25", "bias": "F25", "misalignment": "F25", "quadratic_nonlinearity": "F27",
    "cross_coupling": "F28", "accelerometer_lever_arm": "F29",
}  # fmt: skip

for _i, _j in BLOCKS:
    checks(SOURCE, f"Eq. (23), F{_i}{_j}", where=navigator.GROWTH)(partial(navigator.growth, _i, _j))
checks(SOURCE, "Eq. (17)", where=navigator.UNIT)(navigator.mechanised)
checks(SOURCE, "Eq. (17)", "Eq. (23)", where=navigator.GROWTH)(navigator.all_growth)
checks(SOURCE, "Eq. (17)", where=navigator.GROWTH, tolerance=2e-4)(navigator.ends_of_growth)
checks(SOURCE, "Eq. (24)", *(f"Eq. (23), {b}" for b in dict.fromkeys(COLUMNS.values())), where=navigator.GROWTH)(
    navigator.driven
)
checks(SOURCE, "Eq. (24)", where=navigator.GROWTH)(navigator.noise)
checks(SOURCE, "Eq. (13)", "Eq. (14)", "Eq. (16)", where="inference.adjoint.smooth")(navigator.adjoint_smoother)
checks(SOURCE, "Eq. (15)", where="inference.adjoint.covariance")(navigator.adjoint_covariance)


def _recording() -> Any:
    """Return the four intervals of a unit that turns evenly under an even force."""
    from gimbalcal.platform import BENCH
    from gimbalcal.recording import Recording, Site

    readings = {("specific_force", a): np.full(4, v) for a, v in zip("xyz", FORCE[0], strict=True)}
    readings |= {("angular_rate", a): np.full(4, v) for a, v in zip("xyz", RATE[0], strict=True)}
    return Recording(ROTATION, "generic", BENCH, Site(latitude=0.6), {}, np.arange(4.0), None, readings)


@once
def _columns() -> dict[tuple[str, str], Any]:
    """Return (6,) what the filter takes force and rate to be wrong by, true less computed, by effect and axis of the
    51.
    """
    from gimbalcal.estimate.systematic import error_model
    from gimbalcal.estimate.systematic.state_lists import states

    rows = _recording()
    wanted = states("51", rows.why_not_shown)
    u = np.repeat(np.concatenate([FORCE, RATE], axis=1), 4, axis=0)
    D = error_model.sensitivity(rows, (), wanted, u, slice(1, 3))
    return {(p.effect, p.axis): D[0, :, i] for i, p in enumerate(wanted)}


def _derived() -> dict[tuple[str, str], Any]:
    """Return the same of the derived model: less what is read too much."""
    matrix = [f"{i}{j}" for i in "xyz" for j in "xyz"]
    pairs = [i + j for i in "xyz" for j in "xyz" if i != j]
    of: dict[tuple[str, str], tuple[Any, bool, int]] = {}
    for gyroscopes, fields in ((True, GYRO_FIELDS), (False, ACC_FIELDS)):
        for effect, _, symbols in fields:
            axes = {3: "xyz", 6: pairs, 9: matrix}[len(symbols)]
            of |= {(effect, a): (s, gyroscopes, -1) for a, s in zip(axes, symbols, strict=True)}
    for effect, symbols, gyroscopes in (("gyro_misalignment", GAMMA, True), ("misalignment", ALPHA, False)):
        of |= {(effect, str(s).split("_")[1]): (s, gyroscopes, 1) for s in symbols}
    of |= {("accelerometer_lever_arm", a): (s, False, -1) for a, s in zip(("xx", "yy", "zz"), r, strict=True)}
    out = {}
    for key, (symbol, gyroscopes, sign) in of.items():
        column = np.zeros(6)
        column[slice(3, 6) if gyroscopes else slice(0, 3)] = sign * derived_slopes([symbol], gyroscopes)[:, 0]
        out[key] = column
    return out


def sensitivity(effect: str) -> float:
    """Return the columns of an effect, relative."""
    ours, derived = _columns(), {k: v for k, v in _derived().items() if k[0] == effect}
    size = max(np.abs(v).max() for v in derived.values())
    return float(max(np.abs(ours[k] - v).max() for k, v in derived.items()) / size)


for _effect, _block in COLUMNS.items():
    _model = "Eq. (18)" if "gyro" in _effect else "Eq. (19)"
    checks(SOURCE, _model, f"Eq. (23), {_block}", where=SENSITIVITY)(partial(sensitivity, _effect))


@checks(SOURCE, "Eq. (22)", where="estimate.systematic.state_lists")
def number_of_states() -> float:
    """Return the number of differences from the derived list of states, except those of navigation."""
    missing = set(_derived()) ^ set(_columns())
    return float(len(missing) + abs(9 + len(_columns()) - error_model.number_of_states()))


@checks(SOURCE, "Eq. (25)", "Eq. (26)", where="estimate.systematic.filter_pass.VELOCITY_STATES")
def observed() -> float:
    """Which of the nine are measured."""
    from gimbalcal.estimate.systematic.filter_pass import VELOCITY_STATES

    H = np.zeros((3, 51))
    H[:, 3:6] = np.eye(3)
    return float(np.abs(np.eye(51)[VELOCITY_STATES] - H).max())
