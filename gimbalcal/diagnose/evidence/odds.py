"""Prior odds, and what it takes to claim something: the numbers on which every path of the diagnosis rests."""

from __future__ import annotations

import numpy as np

SINGLE, PAIR, UNKNOWN, BESIDE = 0.65, 0.15, 0.10, 0.10  # prior shares, given that something is missing
# how much likelier before any data, or with less evidence, is what every rig of the kind has
USUAL_CAUSE_BONUS = np.log(10.0)
# ln BF of a single cause beyond which only the promising ones are tried with a second
DETECTION_EVIDENCE = np.log(100.0)
CLAIM = np.log(20.0)  # simulated clean recordings reach it in less than 1 in 1000; 1 in 20 would be the bound
SEPARATION_EVIDENCE = np.log(20.0)  # evidence by which causes must differ to be distinguished: the same odds as a claim
SURE_PROBABILITY = 0.90  # probability of a set of causes from which it is not widened
UNSURE_FACTOR = 0.90  # of its probability is left to a cause that leaves a rest, or more than the stated noise
# kept for laws nobody has written down: some look like one that is, and no data of this kind can tell
UNKNOWN_LAW_SHARE = 0.10
MIN_WIDENING_PROBABILITY = 0.02  # probability from which a cause may widen a set that is not sure
# share of the evidence that a cause alone must carry to be named although a rest has no cause
MIN_SHARE_WITH_REST = 0.90
