"""Say where a model and a recording differ, which physics was left out, and how sure that is.

`entry.diagnose` looks at the recordings and sends them down one of four roads; all return an `answer.Diagnosis`.

    known_noise     attitude and noise are known: 18 positions, a static run
    several         several such recordings of one unit
    both_triads     the same with gyroscopes: accelerometers first, then the gyroscopes
    unknown_noise   nobody states the noise: telescopes, units turned by hand, tilting tables

A road walks down five rooms, each of which reads only those below it:

    rows        what is explained: residuals of a recording about its baseline, and their derivatives
    library     with what: every cause of the catalogue as columns, and the shapes that are no cause
    evidence    how strongly: closed forms, the noise or its scale and memory integrated over; `odds`: priors and bars
    search      which combination: singles, pairs, thirds; constants refined; refit and search again
    verdict     what is claimed: decision, what stands together, held-out check, where it is off, what would tell more

`gimbalcal.words.diagnosis_sentences` has the sentences that the roads share.
"""

import sys
from types import ModuleType
from typing import Any

from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.entry import diagnose

__all__ = ["Diagnosis", "diagnose"]


class _Callable(ModuleType):
    """`gimbalcal.diagnose(recordings)`, beside `gimbalcal.calibrate(recordings)`, although a package has the name."""

    def __call__(self, *args: Any, **options: Any) -> Diagnosis:
        """Return what `gimbalcal.api.diagnose` does."""
        from importlib import import_module

        answer: Diagnosis = import_module("gimbalcal.api").diagnose(*args, **options)
        return answer


sys.modules[__name__].__class__ = _Callable
