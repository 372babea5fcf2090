"""The result of an estimator, applied to recordings, and exchanged with other programs (`exchange`)."""

from gimbalcal.calibration.calibration import (
    FORMAT,
    Calibration,
    ParameterEstimate,
    Residual,
    StageResult,
    from_dict,
    read,
)
from gimbalcal.calibration.readout import Counts, Readout

__all__ = [
    "FORMAT",
    "Calibration",
    "Counts",
    "ParameterEstimate",
    "Readout",
    "Residual",
    "StageResult",
    "from_dict",
    "read",
]
