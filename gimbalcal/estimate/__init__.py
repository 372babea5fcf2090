"""Estimators: functions from a recording to what it says about the parameters."""
