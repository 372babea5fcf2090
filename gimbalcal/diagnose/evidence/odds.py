"""Prior odds and thresholds of evidence that are common to all methods of the diagnosis."""

from __future__ import annotations

import numpy as np

SINGLE, PAIR, UNKNOWN, CAUSE_AND_SHAPE = 0.65, 0.15, 0.10, 0.10  # prior probabilities, given that something is missing
# ln prior odds in favour of an effect that every rig of the kind has
USUAL_CAUSE_BONUS = np.log(10.0)
# ln BF of a single cause beyond which only the promising ones are tried with a second
DETECTION_EVIDENCE = np.log(100.0)
CLAIM = np.log(20.0)  # simulated clean recordings reach it in less than 1 in 1000; 1 in 20 would be the bound
SEPARATION_EVIDENCE = np.log(20.0)  # evidence by which causes must differ to be distinguished: the same odds as a claim
SURE_PROBABILITY = 0.90  # probability above which a set of causes is not widened
UNSURE_FACTOR = 0.90  # factor on the probability of a cause that leaves a residual above the stated noise
# prior probability of laws outside the catalogue, some of which resemble one inside it beyond the resolution of data
UNKNOWN_LAW_SHARE = 0.10
MIN_WIDENING_PROBABILITY = 0.02  # probability above which a cause may widen an unsure set
# share of the evidence that a cause alone must carry to be named although a rest has no cause
MIN_SHARE_WITH_REST = 0.90
