"""The page of a campaign: honest sigmas, sigmas that promise too much, runs that failed."""

from __future__ import annotations

from typing import Any

import pytest

from gimbalcal.report.campaign_page import campaign_report, chance, headline


def campaign(runs: int = 200, ratio: float = 1.02, mean: float = 0.0, failed: int = 0) -> dict[str, Any]:
    """The content of a campaign.json; the second parameter errs as told."""
    sigma = 9.80665e-6
    rows = [{"parameter": f"bias:{a}", "unit": "SI", "runs": runs, "mean": mean * sigma if a == "y" else 0.0,
             "rms": r * sigma, "sigma": sigma, "ratio": r} for a, r in (("x", 0.97), ("y", ratio))]  # fmt: skip
    return {
        "format": 1, "direction": "physics to readings", "runs": runs, "failed": failed,
        "outcomes": {"the fit did not settle": failed} if failed else {}, "parameters": rows, "in_words": "",
        "identity": {"scenario": "0" * 64, "name": "wu2018-18", "kind": "multi-position", "seed": 1,
                     "method": "three-stage", "share": 4, "version": "0.1.0"},
    }  # fmt: skip


def test_honest_sigmas_are_said_to_be() -> None:
    told = headline(campaign())
    assert told.startswith("In 200 runs errors are 0.97 to 1.02 times their σ over 2 parameters; chance alone makes")
    assert told.endswith("The σ are honest.")
    page = campaign_report(campaign())
    assert 'class="answer fits"' in page
    assert '<td>0.970</td><td class="extra">1.00</td><td class="unit">µg</td>' in page


def test_few_runs_prove_little() -> None:
    assert headline(campaign(runs=4, ratio=1.5)).endswith("Next: more of them, -n 200.")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"ratio": 1.6}, "bias y errs more than its σ says."),
        ({"mean": 0.5}, "Off on average: bias y."),
        ({"failed": 3}, "3 runs ended with a reservation: the fit did not settle."),
    ],
)
def test_what_is_wrong_is_named(more: dict[str, Any], words: str) -> None:
    content = campaign(**more)
    assert words in headline(content)
    assert 'class="answer reserved"' in campaign_report(content)


def test_a_campaign_without_an_estimate_has_a_page() -> None:
    content = campaign(failed=200) | {"parameters": []}
    assert headline(content).startswith("200 runs, none with an estimate: the fit did not settle.")
    assert "Runs with a reservation" in campaign_report(content)


def test_chance_is_wider_for_few_runs_and_many_parameters() -> None:
    assert chance(10, 5)[0] < chance(100, 5)[0] < 1 < chance(100, 5)[1] < chance(100, 50)[1] < chance(10, 50)[1]
