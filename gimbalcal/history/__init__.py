"""History of a unit: calibrations and diagnoses in one file, and changes of parameters between them."""

from gimbalcal.history.compare import UnitComparison, compare
from gimbalcal.history.unit_store import (
    DatedCalibration,
    StoredResult,
    date_in,
    dated_file,
    keep,
    kept,
    of_store,
    refuse_unusable,
)

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
    "refuse_unusable",
]
