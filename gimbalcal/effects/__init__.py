"""The catalogue: one definition per physical effect, read by simulator, estimators, diagnosis and derivations.

A new effect is one class in a file of this folder: card, parameters, constants with what they are (`Grid`), what it
needs, its contribution and, where it is no ordinary cause, its `Role` in a diagnosis. Nothing else names it.
"""

import importlib
import pkgutil

from gimbalcal.effects.effect import (
    CATALOGUE,
    Effect,
    Parameter,
    Stage,
    Stimulus,
    known_effect,
    parameters,
    parameters_of_effects,
    values,
    with_values,
    zero_effect,
)
from gimbalcal.effects.loading import load_effects, load_installed

__all__ = [
    "CATALOGUE",
    "Effect",
    "Parameter",
    "Stage",
    "Stimulus",
    "known_effect",
    "load_effects",
    "parameters",
    "parameters_of_effects",
    "values",
    "with_values",
    "zero_effect",
]

for _module in pkgutil.iter_modules(__path__):  # every file here is a family: a new effect needs no other edit
    importlib.import_module(f"{__name__}.{_module.name}")
load_installed()
