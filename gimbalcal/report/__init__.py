"""Render results for a person: a self-contained page for each, with its pictures, and the tables of the console."""

from gimbalcal.report.calibration_page import calibration_report

__all__ = ["calibration_report"]
