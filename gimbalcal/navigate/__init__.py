"""What a calibration is worth on the way: errors of a navigator, propagated."""
