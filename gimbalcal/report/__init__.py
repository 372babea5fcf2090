"""What a person sees: one self-contained page per result, and the pictures and words in it."""

from gimbalcal.report.calibration_page import calibration_report

__all__ = ["calibration_report"]
