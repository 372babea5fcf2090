"""The laws of `bench_laws` are as many and as various as is said, and can be judged; none is diagnosed here."""

import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.collecting import collect, kept
from tests.benchmarks.law_plants import (
    ALIEN,
    DEG,
    HOUR,
    RIGS,
    Hidden,
    corrected,
    excess,
    left_by_itself,
    simulated,
    size_of,
    variables,
)
from tests.benchmarks.law_set import CLEAN, EVERY_LAW, FRESH, LAST, LAST_2, LAST_3, LAWS


def test_six_rigs_have_laws_of_every_sort():
    assert len(LAWS) >= 80
    assert min(Counter(law.rig for law in LAWS.values())[rig] for rig in RIGS) >= 13
    assert sum(not law.determined for law in LAWS.values()) >= 10
    assert sum("noisy" in dict(law.options) for law in LAWS.values()) >= 10
    sets = (LAWS, FRESH, LAST, LAST_2, LAST_3)
    assert len({name for x in sets for name in x}) == sum(len(x) for x in sets)
    assert Counter("alien" in dict(clean.options) for clean in CLEAN.values()) == {False: 100, True: 100}


def test_what_a_law_follows_is_in_its_recording():
    """Else what is said of it could not be judged."""
    known: dict[object, set[str]] = {}
    for name, law in EVERY_LAW.items():
        kind = (law.rig, law.options, law.where.startswith("gyro"))
        if kind not in known:
            known[kind] = set(variables(simulated(3, law, 0.0)))
        assert set(law.follows.replace("|", " ").split()) <= known[kind], name


def test_alien_noise_is_added_to_every_rig_and_differs_from_its_own():
    for rig in ("positions", "static", "hand", "mount", "rate table"):
        where = "azimuth" if rig == "mount" else "x"
        own = simulated(4, Hidden(rig, where, lambda b: 0.0, ""), 0.0)
        for kind in ALIEN:
            r = simulated(4, Hidden(rig, where, lambda b: 0.0, "", options=(("alien", kind),)), 0.0)
            changed = {k for k, x in r.channels.items() if not np.array_equal(x, own.channels[k])}
            assert changed, (rig, kind)
            assert all(np.isfinite(r.channels[k]).all() for k in changed)


def test_a_true_law_of_rates_explains_turns_although_the_gyroscopes_are_biased():
    law = LAWS["scale factor settles"]
    size = size_of(6, law, 30.0)
    r, clean = simulated(7, law, size), simulated(7, law, 0.0)
    said = {"channel": "angular_rate", "axis": "z", "variables": ["rate_z", "time"],
            "expression": f"{size * DEG / HOUR}*rate_z*exp(-time/45)"}  # fmt: skip
    assert excess(r, clean) > 15
    assert excess(corrected(r, [said]), clean) < 1


def test_a_law_is_worth_no_more_than_the_thermometer_that_it_is_taken_at():
    law = Hidden("rotation", "gyro z", lambda m: np.sin(m.T), "temperature", options=(("noisy", 0.2),))
    exact = Hidden("rotation", "gyro z", lambda m: np.sin(m.T), "temperature")
    assert 1 < left_by_itself(7, law, 1e-4) < excess(simulated(7, law, 1e-4), simulated(7, law, 0.0)) / 2
    assert left_by_itself(7, exact, 1e-4) < 0.1


@dataclass(frozen=True)
class Slow:
    key: str


def slowly(run: Slow) -> dict[str, object]:
    time.sleep(0.05)
    return {"key": run.key}


def test_a_limit_of_time_leaves_runs_for_the_next_start(tmp_path):
    wanted, path = [Slow(str(k)) for k in range(30)], tmp_path / "rows.jsonl"
    first = collect(wanted, path, 1, slowly, limit=0.0)
    assert 0 < len(first) < 30
    assert len(kept(path)) == len(first)
    assert len(collect(wanted, path, 1, slowly)) == 30
    assert len(path.read_text(encoding="utf-8").splitlines()) == 30
