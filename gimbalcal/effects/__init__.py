"""The catalogue: one definition per physical effect, read by simulator, estimators, diagnosis and derivations."""

from gimbalcal.effects import (
    accelerometer,
    covariate,
    drift,
    gimbal,
    ground,
    gyroscope,
    memory,
    motion,
    nonlinearity,
    pointing,
    thermal,
)
from gimbalcal.effects.effect import (
    CATALOGUE,
    Effect,
    Parameter,
    Stage,
    Stimulus,
    absent,
    parameters,
    values,
    with_values,
)

__all__ = [
    "CATALOGUE",
    "Effect",
    "Parameter",
    "Stage",
    "Stimulus",
    "absent",
    "accelerometer",
    "covariate",
    "drift",
    "gimbal",
    "ground",
    "gyroscope",
    "memory",
    "motion",
    "nonlinearity",
    "parameters",
    "pointing",
    "thermal",
    "values",
    "with_values",
]
