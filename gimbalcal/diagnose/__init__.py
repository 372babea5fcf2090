"""Say where a model and a recording differ, which physics was left out, and how sure that is."""

from gimbalcal.diagnose.diagnosis import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
