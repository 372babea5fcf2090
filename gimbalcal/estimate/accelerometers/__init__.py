"""Accelerometers from rests: the stages of Wu et al. (2018) at known angles, the norm of gravity at unknown ones."""
