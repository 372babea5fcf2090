"""A search once more, about the model with its strongest cause, where that has dragged the constants far away."""

from __future__ import annotations

import numpy as np

from gimbalcal.diagnose.search.stepwise import Course, course
from gimbalcal.errors import InputError
from gimbalcal.pipeline import Tell
from gimbalcal.views.core import View, absent_effect

DRAGGED = 4.0  # times less misfit with the causes than without: products of errors are no longer nothing


def about_found(v: View, c: Course, tell: Tell) -> tuple[View, Course]:
    """View and course; anew where the rows are linear about constants that a strong cause has dragged away."""
    before, after = (float(np.sum(v.noise.weighted(fit.residual) ** 2)) for fit in (c.start, c.end))
    far = before > DRAGGED * after
    if v.relinearise is None or not c.steps or not far:
        return v, c
    cause, variant = c.steps[0].taken
    tell(f"again, about the constants that belong to {cause.in_words}")
    try:
        v = v.relinearise(
            absent_effect(cause.effect, v.stimulus, cause.source, **dict(variant.constants)), cause.parameters
        )
    except InputError as problem:
        tell(str(problem))
        return v, c
    return v, course(v, tell)
