r"""Calibrate inertial sensors on gimballed platforms, and say what physics a model left out.

Conventions, stated once
------------------------
Frames.
    n: north, east, down. b: base or vehicle; forward, right, down. p: platform. a: accelerometer input axes, not
    orthogonal. ``C_ab`` turns components in frame b into frame a when it stands left of the vector: ``v_a = C_ab v_b``
    is written ``C_bp`` for "base to platform" exactly as :math:`C_b^p` is in Wu et al. (2018). Rotations are those of
    frames (passive), ``Rx(a) = [[1, 0, 0], [0, cos a, sin a], [0, -sin a, cos a]]`` and cyclic.
Signs.
    Specific force f = a - g. A level unit at rest feels f^n = (0, 0, -g): the z accelerometer that points down reads
    about -9.8 m/s^2. Parameters are errors with nominal zero: ``scale_factor`` is SF - 1 in
    f^a = SF^-1 C_p^a f^p + b + K_nl (f^a - b)^2, and gyroscopes alike, omega^g = SF^-1 C_p^g omega^p + ...: what is
    true is SF times the reading; a true gimbal angle is its readout plus ``gimbal_zero``.
Units.
    SI and radians inside, always; ``gimbalcal.units`` at the edges. 1 g is 9.80665 m/s^2; 1 ug across an axis at 1 g
    is 1 urad of tilt.
Arrays.
    Time first: (n, 3) vectors, (n, 3, 3) matrices. One sigma unless said otherwise.
Books.
    Keys into ``gimbalcal.references.REFERENCES`` stand at the lines that use them.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# Loaded on first use, so that `gimbalcal --help` answers at once.
if TYPE_CHECKING:
    from gimbalcal.api import (
        calibrate,
        diagnose,
        from_frame,
        navigate,
        next_step,
        noise,
        observe,
        read_calibration,
        simulate,
    )
    from gimbalcal.calibration import Calibration
    from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, load_effects
    from gimbalcal.errors import InputError
    from gimbalcal.forward import jacobian, predict
    from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings, stimulus_from_truth
    from gimbalcal.platform import SPACE_STABLE, SPACE_STABLE_INERTIAL, Axis, Platform
    from gimbalcal.recording import Recording, from_arrays, read
    from gimbalcal.schedule import EIGHTEEN_POSITIONS, Hold, Schedule

__all__ = [
    "CATALOGUE",
    "EIGHTEEN_POSITIONS",
    "SPACE_STABLE",
    "SPACE_STABLE_INERTIAL",
    "Axis",
    "Calibration",
    "Effect",
    "Hold",
    "InputError",
    "Parameter",
    "Platform",
    "Recording",
    "Schedule",
    "Stage",
    "Stimulus",
    "__version__",
    "calibrate",
    "diagnose",
    "from_arrays",
    "from_frame",
    "jacobian",
    "load_effects",
    "navigate",
    "next_step",
    "noise",
    "observe",
    "predict",
    "read",
    "read_calibration",
    "simulate",
    "stimulus_from_angles",
    "stimulus_from_readings",
    "stimulus_from_truth",
]
CALLED_PACKAGES = ("diagnose", "navigate", "simulate")
_HOMES = ("api", "recording", "calibration", "effects", "errors", "forward", "kinematics", "platform", "schedule")


class CalledPackage(ModuleType):
    """A package with the name of a command: `gimbalcal.diagnose(...)` is the function of that name in `gimbalcal.api`.

    Importing any of its modules binds the package to this name, so that the package itself is what is called.
    """

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Return what the function of this name in `gimbalcal.api` returns."""
        return getattr(import_module("gimbalcal.api"), self.__name__.rpartition(".")[2])(*args, **options)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in CALLED_PACKAGES:
        return import_module(f"gimbalcal.{name}")
    if name in __all__:
        for home in _HOMES:
            module = import_module(f"gimbalcal.{home}")
            if name in vars(module):
                return vars(module)[name]
    raise AttributeError(f"module 'gimbalcal' has no attribute {name!r}")
