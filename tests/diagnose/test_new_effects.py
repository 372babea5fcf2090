"""A new effect is one class: it is simulated, listed, and tried wherever the recording has what it needs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.refit import fit_baseline, start_with_baseline
from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_at_rest, view_of_turns
from gimbalcal.simulate import simulate
from gimbalcal.views.known_attitude import view_at_known_attitude
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import pointing
from gimbalcal.views.tilting_table import tilting_table
from tests.diagnose import static_plant
from tests.diagnose.new_effects import enter
from tests.diagnose.plant import record
from tests.diagnose.shipped_unit import by_hand, scenario
from tests.diagnose.small import telescope, turned
from tests.diagnose.test_odd import tilted

LOGGED = ("vibration", "pressure")


@pytest.fixture(scope="module")
def new():
    ids = enter()
    yield ids
    for i in ids:
        del CATALOGUE[i]


RECORDINGS = {
    "known noise": lambda: record(np.random.default_rng(2), dwell=20),
    "at rest": lambda: static_plant.record(np.random.default_rng(3), step=1800.0),
    "by hand": by_hand,
    "telescope": lambda: telescope(1),
    "table": lambda: tilted(900),
}


def with_logs(r):
    """Channels that wander from rest to rest, with a thermometer; a static run with what a navigator reports."""
    rng = np.random.default_rng(8)
    grid = np.linspace(r.time[0], r.time[-1], 40)
    channels = {("covariate", k): 1 + 0.1 * np.interp(r.time, grid, rng.standard_normal(40).cumsum()) for k in LOGGED}
    warm = {("temperature", ""): 20 + np.interp(r.time, grid, rng.standard_normal(40).cumsum())}
    if r.kind == "static-run":
        channels |= {("attitude_error", a): 1e-7 * rng.standard_normal(len(r.time)) for a in ("roll", "pitch", "yaw")}
    return replace(r, channels=warm | dict(r.channels) | channels)


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_diagnosis_of_any_kind_runs_with_what_they_need(new, name):
    """What they need and is not logged is tried by `test_they_are_causes_where_their_channel_is_logged`."""
    d = diagnose([with_logs(RECORDINGS[name]())])
    assert d.verdict in ("adequate", "unexplained", "missing-physics", "not-identifiable")
    assert not {f["effect"] for f in d.findings} & set(new)  # nothing of theirs is there


def views(r):
    if r.kind == "pointing":
        return [pointing(r)]
    if r.kind == "rotation":
        return [tilting_table(r)]
    found = (norm(r), view_at_rest(r), view_of_turns(r))
    return [v for v in found if v is not None]


def tried(r):
    """Ids of the causes that either road compares."""
    if r.platform.axes and r.kind != "pointing":
        o = fit_baseline(view_at_known_attitude(r))
        return {c.effect for c in assemble_library(o).candidates}
    out = set()
    for v in views(r):
        m = start_with_baseline(v)
        out |= {c.effect for c in assemble_library(m).candidates}
    return out


ALWAYS = {
    "known noise": {"toy_bent", "toy_gimbal_spring", "toy_polygon", "toy_base_jump"},
    "at rest": {"toy_bent", "toy_gimbal_spring", "toy_polygon", "toy_base_jump", "toy_hunt"},
    "by hand": {"toy_gyro_cubic", "toy_bent"},
    "telescope": {"toy_gimbal_spring", "toy_polygon", "toy_base_jump"},
    "table": set(),
}
WHERE_LOGGED = {
    "known noise": {"toy_scale_vibration", "toy_air_mass"},
    "at rest": {"toy_scale_vibration", "toy_air_mass", "toy_coast"},
    "by hand": {"toy_gyro_vibration", "toy_gyro_follows", "toy_scale_vibration"},
    "telescope": {"toy_dome"},
    "table": {"toy_scale_vibration"},
}


@pytest.mark.parametrize("name", RECORDINGS)
def test_they_are_causes_where_their_channel_is_logged_and_nowhere_else(new, name):
    made = RECORDINGS[name]()
    assert tried(made) & set(new) == ALWAYS[name]
    assert tried(with_logs(made)) & set(new) == ALWAYS[name] | WHERE_LOGGED[name]


def test_every_one_of_them_is_tried_somewhere(new):
    assert set().union(*ALWAYS.values(), *WHERE_LOGGED.values()) == set(new)


def test_they_are_listed(new, command, capsys):
    assert command("catalogue") == 0
    listed = capsys.readouterr().out
    assert [i for i in new if i not in listed] == []


def test_they_are_simulated(new):
    """Each changes what a scenario of its kind gives, by what its size says."""
    for i in new:
        if "pointing" in CATALOGUE[i].kinds and len(CATALOGUE[i].kinds) == 1:
            continue  # pointing runs are not simulated
        kind = "static-run" if CATALOGUE[i].kinds == ("static-run",) else "multi-position"
        content: dict[str, Any] = {"format": 1, "kind": kind, "site": {"latitude": {"value": 40.0, "unit": "deg"}}}
        content["environment"] = {"covariates": {k: {"shape": "ramp", "mean": 1.0, "rate": 0.5} for k in LOGGED}}
        if CATALOGUE[i].channel == "angular_rate":
            content = {**scenario(holds=3), "environment": content["environment"]}
        elif kind == "static-run":
            content["schedule"] = {"duration": {"value": 2.0, "unit": "h"}, "rate": {"value": 0.01, "unit": "Hz"}}
        else:
            content["schedule"] = {"name": "wu2018-18", "dwell": {"value": 60, "unit": "s"},
                                   "rate": {"value": 0.1, "unit": "Hz"}}  # fmt: skip
        p = parameters(CATALOGUE[i], ("platform", "inner", "middle"))[0]
        size = {p.field: 3.0} if not p.axis else {p.axis: 3.0}
        without, with_it = (simulate({**content, "truth": t}, seed=2)[0] for t in ({}, {i: size}))
        changed = [k for k in without.channels if not np.array_equal(without.channels[k], with_it.channels[k])]
        assert changed, i


def test_what_a_gyroscope_makes_of_vibration_is_named_with_its_size(new):
    """86 deg/h rms from rest to rest, in a logged vibration of a tenth of g."""
    r = with_logs(by_hand())
    truth = 38000.0  # deg/h/g^2
    shaken = truth * np.pi / 648000 * (r.channels["covariate", "vibration"] / G0) ** 2
    channels = {**r.channels, ("angular_rate", "y"): r.channels["angular_rate", "y"] + shaken}
    (found,) = diagnose([replace(r, channels=channels)]).findings
    assert (found["effect"], found["axis"], found["twins"]) == ("toy_gyro_vibration", "y", [])
    (size,) = found["parameters"]
    assert abs(size["value"] - truth) < 4 * size["sigma"]


@pytest.mark.parametrize("seed", [5, 8])
def test_a_bias_that_follows_a_logged_channel_is_named_where_no_noise_is_known(seed):
    r = turned(seed)
    fan = 100 * np.repeat(np.random.default_rng(seed + 50).standard_normal(40), 10)  # one value in each rest
    follows = 3e-5 * (fan - fan.mean())  # m/s^2, 3.06 ug per unit
    z = {("specific_force", "z"): r.channels["specific_force", "z"] + follows, ("covariate", "fan"): fan}
    (found,) = diagnose([replace(r, channels={**r.channels, **z})]).findings
    assert (found["effect"], found["axis"]) == ("bias_covariate", "z")
    (size,) = found["parameters"]
    assert abs(size["value"] - 3.06) < 4 * size["sigma"] < 2.0
