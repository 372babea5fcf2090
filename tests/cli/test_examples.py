"""Every command ends its help with an example, and what pages and help tell to type is what the program takes."""

import re
import shlex
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from gimbalcal.cli import CONTEXT, gimbalcal
from gimbalcal.cli.catalogue import matching_effects
from tests.golden import refused

ROOT = Path(__file__).parents[2]
PAGES = [
    *(p for p in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in p.parts),
    ROOT / "README.md",
    ROOT / "data" / "README.md",
]
BLOCK = re.compile(r"^```(?:console|sh|bash)?\n(.*?)^```", re.MULTILINE | re.DOTALL)


def accepted(line: str) -> None:
    """Raises where the command line does not take these words; nothing is run."""
    name, *words = shlex.split(line, comments=True)[1:]
    command = gimbalcal.commands[name]
    with command.make_context(name, words, parent=click.Context(gimbalcal, **CONTEXT)):
        pass


@pytest.mark.parametrize("name", sorted(gimbalcal.commands))
def test_help_ends_with_an_example_that_the_command_takes(name: str) -> None:
    told = CliRunner().invoke(gimbalcal, [name, "--help"], terminal_width=100).output
    _, found, lines = told.partition("For example:\n")
    assert found
    for line in lines.strip().splitlines():
        assert line.split()[:2] == ["gimbalcal", name]
        accepted(line)


def typed(page: Path) -> list[str]:
    """Lines of the blocks of a page that are commands; where a block has prompts, those behind one."""
    out = []
    for block in BLOCK.findall(page.read_text()):
        lines = [line.strip() for line in block.split("\n")]
        prompted = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        out += [line for line in prompted or lines if line.startswith("gimbalcal ") and "[" not in line]
    return out


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_what_a_page_tells_to_type_is_taken(page: Path) -> None:
    for line in typed(page):
        accepted(line)


def test_a_page_has_commands_and_a_wrong_one_is_refused() -> None:
    assert len(typed(ROOT / "docs" / "real-recordings.md")) > 5
    with pytest.raises(click.ClickException, match="No such option"):
        accepted("gimbalcal diagnose data/space_stable_18 --output here")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("latency", ["gyro_latency", "readout_latency", "time_tag_latency"]),
        ("time tag", ["time_tag_latency"]),
        ("Worm", ["periodic_worm_error"]),
        ("clutch", ["gimbal_zero_drift", "gimbal_zero_step"]),
    ],
)
def test_effects_are_found_by_a_word_of_their_name_or_else_of_their_card(words: str, found: list[str]) -> None:
    assert matching_effects(words) == found


def test_a_word_that_no_card_has_is_refused() -> None:
    with refused():
        matching_effects("phlogiston")
    with refused():
        matching_effects("scael_factor")
