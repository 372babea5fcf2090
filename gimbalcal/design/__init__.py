"""Predict what a schedule determines, and design the schedule that determines most."""
