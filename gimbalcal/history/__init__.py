"""History of a unit: calibrations and diagnoses in one file, and changes of parameters between them."""

from gimbalcal.history.compare import UnitComparison, compare
from gimbalcal.history.dated_calibration import DatedCalibration, date_in, dated_file, of_store
from gimbalcal.history.unit_store import StoredResult, keep, kept

__all__ = [
    "DatedCalibration",
    "StoredResult",
    "UnitComparison",
    "compare",
    "date_in",
    "dated_file",
    "keep",
    "kept",
    "of_store",
]
