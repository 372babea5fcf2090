"""History of a unit: calibrations and diagnoses in one file, and changes of parameters between them."""

from gimbalcal.history.compare import UnitComparison, compare
from gimbalcal.history.unit_store import (
    CALIBRATION,
    DIAGNOSIS,
    FAILURE,
    DatedCalibration,
    StoredResult,
    date_in,
    dated_calibrations,
    dated_file,
    keep,
    kept_entries,
    of_store,
    refuse_unusable,
)

__all__ = [
    "CALIBRATION",
    "DIAGNOSIS",
    "FAILURE",
    "DatedCalibration",
    "StoredResult",
    "UnitComparison",
    "compare",
    "date_in",
    "dated_calibrations",
    "dated_file",
    "keep",
    "kept_entries",
    "of_store",
    "refuse_unusable",
]
