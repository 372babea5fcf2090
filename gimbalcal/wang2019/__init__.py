"""The laboratory of Wang et al. (2019): triads read in pulses, fits, trials of its tables, errors on its motions."""
