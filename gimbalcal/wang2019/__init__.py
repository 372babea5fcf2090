"""The laboratory of Wang et al. (2019): triads read in pulses, their fits, and Monte Carlo trials of its tables."""
