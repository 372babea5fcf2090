"""The comparison with golden files finds what changed, and nothing that only rounding changed."""

import re

import pytest

import tests.golden as module
from tests.golden import Golden, golden_text, page_text, same


@pytest.mark.parametrize(
    ("kept", "now", "equal"),
    [
        ("bias x 1.24 ± 0.10 µg", "bias x 1.25 ± 0.10 µg", True),
        ("1021 µg rms", "1019 µg rms", True),
        ("0.83", "0.85", False),
        ("15 of 18 parameters", "16 of 18 parameters", False),
        ("at positions 4 and 10", "at positions 4 and 11", False),
        ("a delay of 3.2 ms", "a delay of −3.2 ms", False),
        ("1.00e-07", "1.00e-06", False),
        ("wu2018-18", "wu2018-19", False),
        ("one line", "one line\nand another", False),
    ],
)
def test_words_must_be_equal_and_numbers_agree_within_rounding(kept, now, equal):
    assert same(kept.splitlines(), now.splitlines()) is equal


def test_a_golden_file_is_written_only_where_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    with pytest.raises(AssertionError, match="--regenerate-golden"):
        Golden(False)("a/page", "some  text")
    Golden(True)("a/page", "some  text of 1.24")
    assert (tmp_path / "a/page.txt").read_text() == "some text of 1.24\n"
    Golden(True)("a/page", "some text of 1.25")  # a difference of rounding is not written
    Golden(False)("a/page", "some text of 1.24")
    with pytest.raises(AssertionError, match=r"\+other text"):
        Golden(False)("a/page", "other text")


def test_the_text_of_a_page_has_a_line_for_each_row_and_the_titles_of_its_charts():
    page = ('<style>p {}</style><h1>A <b>title</b></h1><table><tr><th>bias</th><td>1</td></tr></table>'
            '<figure><div aria-label="what it shows"><svg data-words="t [s]|x"><text class="title">bias</text>'
            "<text>0.5</text></svg></div></figure><script>x()</script>")  # fmt: skip
    assert page_text(page).splitlines() == [
        "A title", "bias | 1", "what it shows", "chart axes: t [s]|x", "chart: bias"
    ]  # fmt: skip


def test_every_section_of_the_messages_is_of_a_test():
    """Sections of tests that were renamed or deleted go too."""
    folder = module.FOLDER / "messages"
    for file in sorted(folder.rglob("*.txt")):
        home = module.ROOT / "tests" / ("" if file.stem == "tests" else file.relative_to(folder).with_suffix(""))
        for stem, test in re.findall(r"^== (\w+) (\w+)", file.read_text(encoding="utf-8"), re.MULTILINE):
            assert f"def {test}(" in (home / f"{stem}.py").read_text(encoding="utf-8"), f"{file}: {test}"


def test_messages_are_compared_with_the_section_of_the_test(monkeypatch):
    golden_text("bias x 1.24 ug in row 2001", f"{module.ROOT}/data was read")
    with monkeypatch.context() as comparing, pytest.raises(AssertionError, match="--regenerate-golden"):  # noqa: PT012
        comparing.setattr(module.MESSAGES[-1], "regenerate", False)
        golden_text("one that stands in no section")
