"""The list of mistakes that `tests.mutate` makes: each of them has its place in the present code."""

from pkgutil import resolve_name

from tests.mutation.chosen import ROOMS, chosen
from tests.mutation.equivalent import EQUIVALENT


def test_every_mistake_of_the_list_has_its_place_in_the_code():
    outdated: list[str] = []
    assert sum(1 for room in ROOMS for _ in chosen(room, outdated)) > 100
    assert not outdated


def test_every_statement_on_an_equivalent_mistake_is_of_a_function_that_exists():
    for name, _ in EQUIVALENT:
        assert callable(resolve_name(f"gimbalcal.{name}")), name
