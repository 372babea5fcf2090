"""The result of an estimator, applied to recordings, and exchanged with other programs (`exchange`)."""

from gimbalcal.calibration.calibration import (
    FORMAT,
    Calibration,
    ParameterEstimate,
    Residual,
    StageHistory,
    StageResult,
    from_dict,
    read,
)
from gimbalcal.calibration.provenance import DIRECTION, AssumedNoise, Options, Provenance
from gimbalcal.calibration.readout import Counts, Readout

__all__ = [
    "DIRECTION",
    "FORMAT",
    "AssumedNoise",
    "Calibration",
    "Counts",
    "Options",
    "ParameterEstimate",
    "Provenance",
    "Readout",
    "Residual",
    "StageHistory",
    "StageResult",
    "from_dict",
    "read",
]
