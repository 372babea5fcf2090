"""The text of every kind of page."""

import pytest

from tests.golden import page_text
from tests.report.pages import LONG, PAGES, page


@pytest.mark.parametrize("name", PAGES)
def test_the_text_of_a_page(name, golden):
    golden(f"pages/{name}", page_text(page(name)).replace(LONG, "LONG TITLE"))
