"""Errors of a navigator with and without a calibration."""
