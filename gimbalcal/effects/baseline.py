"""What a calibrated model holds, by what is looked at: no finding, unless a user leaves it out of the baseline."""

from __future__ import annotations

from collections.abc import Mapping

BASELINE: Mapping[str, tuple[str, ...]] = {
    # kinds of recording: the coefficients of Wu et al. (2018), Eq. (6); in a static run how the platform stands too
    "multi-position": ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero"),
    "static-run": (
        "scale_factor",
        "bias",
        "scale_nonlinearity",
        "misalignment",
        "gimbal_zero",
        "base_tilt",
        "polar_axis_misalignment",
    ),
    "rotation": ("scale_factor", "bias", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment"),
    "pointing": ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality"),
    # what is left where no angle is known: Wang et al. (2019), Eqs. (2) and (6), linear terms
    "norm": ("bias", "scale_factor", "misalignment"),
    "rest rates": ("gyro_bias",),
    "turns": ("gyro_scale_factor", "gyro_misalignment"),
    "table": ("bias",),
}
