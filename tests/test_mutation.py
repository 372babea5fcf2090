"""A mistake that somebody wrote down is made in the place it names, in one process, and taken back."""

import pytest

from tests.history.test_parameter_history import of
from tests.mutation.chosen import ROOMS, chosen
from tests.mutation.rewrite import mistaken

COURSE = "gimbalcal.history.parameter_history"


def test_a_mistake_is_made_and_taken_back():
    def clear():
        return of([0, 6], [3, 4]).clear

    mutant = mistaken(COURSE, "ParameterHistory.clear", "np.hypot(self.sigma[1:], self.sigma[:-1])", "self.sigma[1:]")
    assert clear() == pytest.approx(6 / 5)
    undo = mutant.install()
    assert clear() == pytest.approx(6 / 4)
    undo()
    assert clear() == pytest.approx(6 / 5)


@pytest.mark.parametrize(
    ("module", "function", "before", "words"),
    [(COURSE, "_weighted_mean", "sigma**-3", "0 times, and not once"),
     (COURSE, "_weighted_mean", "w", "times, and not once"),
     (COURSE, "_median", "w", "is not there any more"), ("gimbalcal.nowhere", "_mean", "w", "is not there any more")],
)  # fmt: skip
def test_a_mistake_that_has_no_place_is_named(module, function, before, words):
    with pytest.raises(ValueError, match=words):
        mistaken(module, function, before, "x")


@pytest.mark.parametrize("room", ROOMS)
def test_every_listed_mistake_can_still_be_made(room):
    outdated: list[str] = []
    assert list(chosen(room, outdated))
    assert outdated == []
