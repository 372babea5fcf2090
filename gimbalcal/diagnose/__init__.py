"""Say where a model and a recording differ, which physics was left out, and how sure that is.

`entry.diagnose` checks the recordings; `of_recording` says which views they have, diagnoses them in order and joins
what they say (`view_result`) by `joint_diagnosis` into one answer (`answer`, of the entries in `result`). Then `entry`
adds what else speaks against it, `law_calibration` calibrates with a law, and `cost` navigates with what was found. The
search reads views alone, `verdict.separation` plans from the recording of a view. Two programs diagnose views:

    known_noise      the scale of the noise is known: forces at known attitude, of one or several recordings of a unit
    estimated_noise  the scale of the noise is estimated: stars, units turned by hand, gyroscopes, tilting tables

They share five packages, each of which reads only those below it:

    laws        a formula for what no cause explains
    verdict     what is claimed: decision, alternatives, held-out check, where it is off, separating experiment
    search      which combination of causes: singles, pairs, thirds; constants refined; refit and search again
    evidence    how strongly: closed forms, integrated over the noise or its scale and memory
    library     every cause of the catalogue as columns, and shapes that are no cause
"""

import sys

from gimbalcal import CalledPackage
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.entry import diagnose

__all__ = ["Diagnosis", "diagnose"]

sys.modules[__name__].__class__ = CalledPackage
