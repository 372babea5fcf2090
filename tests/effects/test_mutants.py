"""The laws of `test_laws` notice a falsified effect: one mutant of each here, all in `python -m tests.mutate`."""

import numpy as np

from gimbalcal.effects import CATALOGUE
from tests.effects.test_laws import off_its_law
from tests.mutation.effects import copied, survivors


def test_a_falsified_effect_is_noticed():
    with np.errstate(all="ignore"):
        assert list(survivors(one=True)) == []


def test_a_copy_that_is_not_falsified_is_not_noticed():
    cls = CATALOGUE["cubic_nonlinearity"]
    assert off_its_law("cubic_nonlinearity", copied(cls, cls.contribution)) < 1e-12


def test_what_stayed_green_before_is_noticed():
    cls = CATALOGUE["cubic_nonlinearity"]
    fifth = copied(cls, lambda e, s: -cls.contribution(e, s) * s.force**2)  # -K f^5
    assert off_its_law("cubic_nonlinearity", fifth) > 1.0
