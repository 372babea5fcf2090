"""Recordings proposed from logs that nobody described: what `gimbalcal new` and `from_frame` without columns do."""
