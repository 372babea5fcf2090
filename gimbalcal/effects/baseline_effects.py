"""Effects of a calibrated model: no findings of a diagnosis unless a user leaves them out of the baseline."""

from __future__ import annotations

from collections.abc import Mapping

# Where no gimbal angle is known: the linear terms of Wang et al. (2019), Eqs. (2) and (6).
ACCELEROMETER_BIAS = ("bias",)
ACCELEROMETER_TERMS = ("bias", "scale_factor", "misalignment")
GYROSCOPE_BIAS = ("gyro_bias",)
GYROSCOPE_INPUT_TERMS = ("gyro_scale_factor", "gyro_misalignment")

_WU2018 = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")  # Wu et al. (2018), Eq. (6)

BASELINE: Mapping[str, tuple[str, ...]] = {
    "multi-position": _WU2018,
    "static-run": (*_WU2018, "base_tilt", "polar_axis_misalignment"),
    "rotation": ("scale_factor", "bias", "misalignment", *GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS),
    "pointing": ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality"),
}
"""Ids of the effects by the kind of the recording that is calibrated."""
