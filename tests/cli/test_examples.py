"""Every command ends its help with an example, and what pages and help tell to type is what the program takes."""

import re
import shlex

import click
import pytest
from click.testing import CliRunner

from gimbalcal.cli import CONTEXT, GROUPS, first_sentence, gimbalcal
from gimbalcal.cli.catalogue import matching_effects
from tests.golden import refused
from tests.paths import DATA, ROOT

PAGES = [
    *(p for p in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in p.parts),
    ROOT / "README.md",
    DATA / "README.md",
]
BLOCK = re.compile(r"^```(?:console|sh|bash)?\n(.*?)^```", re.MULTILINE | re.DOTALL)


def accepted(line):
    """Raises where the command line does not take these words; nothing is run."""
    name, *words = shlex.split(line, comments=True)[1:]
    command = gimbalcal.commands[name]
    with command.make_context(name, words, parent=click.Context(gimbalcal, **CONTEXT)):
        pass


@pytest.mark.parametrize("name", sorted(gimbalcal.commands))
def test_help_ends_with_an_example_that_the_command_takes(name):
    told = CliRunner().invoke(gimbalcal, [name, "--help"], terminal_width=100).output
    _, found, lines = told.partition("For example:\n")
    assert found
    for line in lines.strip().splitlines():
        assert line.split()[:2] == ["gimbalcal", name]
        accepted(line)


def test_help_lists_every_command_once_by_a_whole_sentence():
    listed = [str(c.name) for group in GROUPS.values() for c in group]
    assert sorted(listed) == sorted(gimbalcal.commands)
    assert len(set(listed)) == len(listed)
    told = re.sub(r"\s+", " ", CliRunner().invoke(gimbalcal, ["--help"]).output)
    for command in gimbalcal.commands.values():
        sentence = first_sentence(command)
        assert re.fullmatch(r"[A-Z][a-z]+ [^.]*(\.[a-z][^.]*)*\.", sentence), sentence
        assert f"{command.name} {sentence}" in told


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_are_given_the_code_that_completes(shell):
    told = CliRunner().invoke(gimbalcal, ["--completion", shell])
    assert told.exit_code == 0
    assert "_GIMBALCAL_COMPLETE" in told.output
    assert CliRunner().invoke(gimbalcal, ["--completion", "csh"]).exit_code == 2


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("di", ["plain,diagnose"]),
        ("catalogue gyro_bias_d", ["plain,gyro_bias_drift"]),
        ("observe wei", ["plain,wei2022-30"]),
        ("budget wu", ["plain,wu2018-18", "plain,wu2018-static"]),
        ("export ka", ["plain,kalibr"]),
        ("import mi", ["plain,mikoff"]),
        ("calibrate data --with worm", ["file,worm"]),
    ],
)
def test_commands_and_names_are_completed(words, found):
    """As bash asks for it: the words typed so far, and which of them is to be completed."""
    typed_words = ["gimbalcal", *words.split()]
    asked = {
        "_GIMBALCAL_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(typed_words),
        "COMP_CWORD": str(len(typed_words) - 1),
    }
    told = CliRunner().invoke(gimbalcal, [], env=asked, prog_name="gimbalcal")
    assert told.output.split() == found


def typed(page):
    """Lines of the blocks of a page that are commands; where a block has prompts, those behind one."""
    out = []
    for block in BLOCK.findall(page.read_text()):
        lines = [line.strip() for line in block.split("\n")]
        prompted = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        out += [line for line in prompted or lines if line.startswith("gimbalcal ") and "[" not in line]
    return out


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_what_a_page_tells_to_type_is_taken(page):
    for line in typed(page):
        accepted(line)


def test_a_page_has_commands_and_a_wrong_one_is_refused():
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
        ("gsens", ["gyro_g_sensitivity", "gyro_g_sensitivity_rate"]),
        ("g-sens rate", ["gyro_g_sensitivity_rate"]),
        ("K3", ["cubic_nonlinearity"]),
    ],
)
def test_effects_are_found_by_a_word_of_their_name_or_else_of_their_card(words, found):
    assert matching_effects(words) == found


def test_a_word_that_no_card_has_is_refused():
    with refused():
        matching_effects("phlogiston")
    with refused():
        matching_effects("scael_factor")
