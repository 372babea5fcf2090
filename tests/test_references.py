import re

import pytest

from gimbalcal.references import REFERENCES, cite


def test_each_work_is_cited_once_and_in_order_of_mention():
    citations = cite("wu2018", "cai2016", "wu2018")
    assert citations == (REFERENCES["wu2018"], REFERENCES["cai2016"])


def test_unknown_key_names_the_known_ones():
    with pytest.raises(KeyError, match=r"'wu2081'.*wu2018"):
        cite("wu2018", "wu2081")


@pytest.mark.parametrize("key", sorted(REFERENCES))
def test_year_of_a_key_is_in_its_citation(key):
    year = re.search(r"(?:19|20)\d\d$", key)
    assert year is None or year[0] in REFERENCES[key]


def test_no_work_stands_twice():
    assert len({text.casefold() for text in REFERENCES.values()}) == len(REFERENCES)
