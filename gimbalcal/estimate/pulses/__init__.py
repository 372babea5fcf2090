"""Triads that are read in pulses: the polynomial model and the fits of Wang et al. (2019)."""
