"""The result of an estimator, applied to recordings, and exchanged with other programs (`exchange`)."""

from gimbalcal.calibration.calibration import FORMAT, GIMBAL_NAMES, Calibration, Residual, Stage, from_dict, read

__all__ = ["FORMAT", "GIMBAL_NAMES", "Calibration", "Residual", "Stage", "from_dict", "read"]
