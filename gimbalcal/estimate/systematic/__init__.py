"""Systematic calibration of both triads by navigation in place: a unit is turned through stops."""
