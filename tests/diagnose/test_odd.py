"""Recordings that are short, sparse, constant or incomplete: a verdict, or one sentence that says what is lacking."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import cli
from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.library.assemble import available_effects
from gimbalcal.diagnose.library.candidates import covariate_sources
from gimbalcal.diagnose.search.refit import fit_baseline, start_with_baseline
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_at_rest
from gimbalcal.platform import BENCH, KNOWN
from gimbalcal.recording import Recording, Site, dwell_means, write
from gimbalcal.views.known_attitude import view_at_known_attitude
from gimbalcal.views.norm import inverted
from gimbalcal.views.pointing import pointing
from gimbalcal.words.diagnosis_sentences import largest_misfit_sentence
from tests.diagnose import plant, static_plant
from tests.diagnose.plant import UG, at_strength, known, on, record
from tests.diagnose.shipped_unit import by_hand as turned_by_hand
from tests.diagnose.small import telescope
from tests.golden import refused

TABLE = KNOWN["three-axis-table"]
TEMPERATURE = ("temperature", "")
CLEAN = record(np.random.default_rng(2))
AT_REST = static_plant.record(np.random.default_rng(3), step=1800.0)


def changed(r, channels=None, without=()):
    """Other channels, or fewer: quantities, or (quantity, axis)."""
    kept = {k: v for k, v in r.channels.items() if k not in without and k[0] not in without}
    return replace(r, channels={**kept, **(channels or {})})


def first_rows(r, count):
    """So many rows of each position."""
    assert r.position is not None
    return r.select(np.sort(np.concatenate([np.flatnonzero(r.position == p)[:count] for p in np.unique(r.position)])))


def held(r, *positions):
    return r.select(np.isin(r.position, positions))


ODD = {
    "one position": lambda: held(CLEAN, 1),
    "three positions": lambda: held(CLEAN, 1, 5, 9),
    "one row in each position": lambda: first_rows(CLEAN, 1),
    "two rows in each position": lambda: first_rows(CLEAN, 2),
    "means of positions": lambda: dwell_means(CLEAN),
    "constant temperature": lambda: changed(CLEAN, {TEMPERATURE: np.full(len(CLEAN.time), 21.0)}),
    "constant temperature at rest": lambda: changed(AT_REST, {TEMPERATURE: np.full(len(AT_REST.time), 21.0)}),
    "constant covariate": lambda: changed(CLEAN, {("covariate", "fan"): np.full(len(CLEAN.time), 3.0)}),
    "no temperature": lambda: changed(CLEAN, without=["temperature"]),
    "two accelerometers": lambda: changed(CLEAN, without=[("specific_force", "z")]),
    "no platform angle at rest": lambda: changed(AT_REST, without=[("gimbal_angle", "platform")]),
    "one accelerometer": lambda: changed(CLEAN, without=[("specific_force", "x"), ("specific_force", "z")]),
    "a clock from midnight": lambda: replace(CLEAN, time=CLEAN.time + 40000.0),
    "no noise stated": lambda: replace(CLEAN, noise={}),
}


@pytest.mark.parametrize("name", ODD)
def test_an_odd_recording_without_a_fault_is_adequate(name):
    d = diagnose([ODD[name]()])
    assert (d.verdict, d.findings) == ("adequate", ())
    assert np.isfinite(d.fit["chi2_reduced_before"])


def test_two_accelerometers_show_a_cause_of_theirs():
    error, ids = known(1)["asymmetry"]
    d = diagnose([changed(at_strength(11, error, 25.0), without=[("specific_force", "x")])])
    assert {f["effect"] for f in d.findings} == ids
    assert {f["axis"] for f in d.findings} == {"y"}


def test_a_size_that_nothing_shows_is_not_told():
    """All axes together are one cause; of the accelerometer that was not logged nothing is said, not even zero."""
    r = at_strength(11, lambda b: {"output": np.abs(b.ideal) * [1.0, 1.0, 0.0]}, 40.0)
    (found,) = diagnose([changed(r, without=[("specific_force", "z")])]).findings
    assert found["axis"] == "x, y, z"
    assert [p["axis"] for p in found["parameters"]] == ["x", "y"]


@pytest.mark.parametrize("few", ["positions", "accelerometers"])
def test_a_rest_is_told_although_no_fault_of_setting_can_be_looked_for(few):
    """Five positions, or two accelerometers, do not show which position was interchanged; the rest is told."""
    r = at_strength(8, lambda b: on(1, np.sin(2 * np.pi * b.t / 130.0)), 60.0)
    d = diagnose([held(r, 1, 3, 5, 8, 11) if few == "positions" else changed(r, without=[("specific_force", "z")])])
    assert d.verdict == "unexplained"
    assert "y" in d.unexplained[0]["channel"]


LONG = 6000  # rows of a run that is averaged before it is diagnosed


def test_a_gap_in_a_long_static_run_is_not_taken_for_physics():
    """A block that reaches across 400 min would lose a third of the force: blocks end where the clock jumps."""
    r = static_plant.record(np.random.default_rng(3), hours=LONG / 60, step=60.0)
    row = np.arange(len(r.time))
    whole, broken = (
        fit_baseline(view_at_known_attitude(r.select(rows)), steps=0)
        for rows in (row >= 0, (row <= 2000) | (row > 2400))
    )
    assert len(broken.residual) < LONG / 2
    assert np.abs(broken.residual).max() < 1.1 * np.abs(whole.residual).max()  # same noise, same constants


def test_positions_of_a_static_run_do_no_harm():
    """The experiment that would tell twins apart is laid out with the positions that were written down."""
    r = static_plant.record(np.random.default_rng(22), lambda s: s.ideal**2, 20 * UG)
    linear = [i for i in BASELINE["static-run"] if i != "scale_nonlinearity"]
    d = diagnose([replace(r, position=np.ones(len(r.time), dtype=np.int64))], baseline=linear)
    assert d.verdict == "not-identifiable"
    assert d.findings[0]["separate_by"]


def test_without_a_readout_of_the_platform_gimbal_the_force_tells_the_phase():
    r = changed(static_plant.record(np.random.default_rng(1)), without=[("gimbal_angle", "platform")])
    assert np.sqrt(np.mean(fit_baseline(view_at_known_attitude(r)).residual ** 2)) == pytest.approx(
        1.0, abs=0.1
    )  # 1440 numbers: 4 sigma, and a K of 1e-6


def test_rests_of_one_row_each_count_alike():
    """One row says nothing of its own scatter: no rest is surer than another."""
    r = turned_by_hand()
    view = view_at_rest(first_rows(r.select(r.position > 0), 1))
    assert view.noise.sigma is None
    assert np.isfinite(start_with_baseline(view).covariance).all()


# --- covariates that have an effect of their own ----------------------------------------------------------------------


def follows(name, size):
    """A bias that follows a logged channel."""

    def error(b):
        x = np.cumsum(np.random.default_rng(5).standard_normal(int(b.visit.max()) + 1))[b.visit]
        return {**on(1, x - x.mean()), name: x * size}

    return error


@pytest.mark.parametrize(("name", "swing", "effect"), [("pressure", 1e4, "pressure"), ("fan", 1.0, "bias_covariate")])
def test_a_logged_channel_is_named_by_its_own_effect(monkeypatch, name, swing, effect):
    monkeypatch.setattr(plant, "LOGS", (name,))
    (found,) = diagnose([at_strength(11, follows(name, swing), 25.0)]).findings
    assert (found["effect"], found["axis"], found["twins"]) == (effect, "y", [])


def test_effects_of_named_channels_are_candidates_where_these_were_logged():
    n = len(CLEAN.time)
    x = np.linspace(0, 1, n)
    named = {("covariate", k): x for k in ("pressure", "servo_x", "servo_y", "servo_z", "fan")}
    o = fit_baseline(view_at_known_attitude(changed(CLEAN, named)))
    assert {"pressure", "servo_following_error"} <= set(available_effects(o.view))
    assert not {"supply_voltage", "vibration_rectification"} & set(available_effects(o.view))
    assert covariate_sources(CATALOGUE["pressure"], o.view.stimulus) == ("",)
    assert covariate_sources(CATALOGUE["bias_covariate"], o.view.stimulus) == ("fan",)
    assert "fan" in covariate_sources(CATALOGUE["bias_covariate_squared"], o.view.stimulus)


# --- refused ----------------------------------------------------------------------------------------------------------


FORCES_AT_REST = changed(AT_REST, without=["gimbal_angle"])


def spoiled(channel):
    x = CLEAN.channels[channel].copy()
    x[9] = np.nan
    return changed(CLEAN, {channel: x})


def by_hand(positions):
    """A unit that somebody turned: 20 rows in each rest."""
    rng = np.random.default_rng(4)
    g = rng.standard_normal((positions, 3))
    f = 9.8 * g / np.linalg.norm(g, axis=1, keepdims=True)
    f = np.repeat(f, 20, axis=0) + 1e-3 * rng.standard_normal((20 * positions, 3))
    at = np.repeat(np.arange(1, positions + 1), 20)
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    return Recording(
        "multi-position", "by hand", BENCH, Site(None, 0.0, 9.8), {}, np.arange(len(at)) * 1.0, at, channels
    )


def tilted(rows, **units):
    rng = np.random.default_rng(5)
    channels = {(q, a): 1e-3 * rng.standard_normal(rows) for q in ("specific_force", "angular_rate") for a in "xyz"}
    return Recording("rotation", "table", BENCH, Site(0.7, 0.0, 9.8), {}, np.arange(rows) * 0.01, None, channels,
                     units={k: units.get(k[0], "m/s^2") for k in channels})  # fmt: skip


def few_stars(count):
    return telescope(1).select(slice(0, count))


REFUSED = {
    "one row": (lambda: CLEAN.select([0]), ()),
    "two rows, two positions": (lambda: CLEAN.select([0, 120]), ()),
    "one row at rest": (lambda: AT_REST.select([0]), ()),
    "never at rest": (lambda: replace(CLEAN, position=0 * CLEAN.position), ()),
    "no noise to be seen": (lambda: replace(first_rows(CLEAN, 2), noise={}), ()),
    "NaN force": (lambda: spoiled(("specific_force", "y")), ()),
    "NaN temperature": (lambda: spoiled(TEMPERATURE), ()),
    "no angles": (lambda: changed(CLEAN, without=["gimbal_angle"]), ()),
    "at rest by hand": (lambda: replace(FORCES_AT_REST, platform=BENCH), ()),
    "at rest on a table": (lambda: replace(FORCES_AT_REST, platform=TABLE), ()),
    "no force": (lambda: changed(CLEAN, without=["specific_force"]), ()),
    "by hand, no force": (lambda: changed(by_hand(12), without=["specific_force"]), ()),
    "by hand, six positions": (lambda: by_hand(6), ()),
    "one star": (lambda: few_stars(1), ()),
    "a short table": (lambda: tilted(150), ()),
    "a table turned far": (lambda: changed(tilted(900), {("specific_force", "x"): np.linspace(-3, 3, 900)}), ()),
    "a table in counts": (lambda: tilted(900, specific_force="count"), ()),
    "another kind": (lambda: CLEAN, ("refraction",)),
    "no thermometer": (lambda: changed(CLEAN, without=["temperature"]), ("bias", "bias_temperature")),
    "no such log": (lambda: CLEAN, ("pressure",)),
    "no log": (lambda: CLEAN, ("bias_covariate",)),
    "two logs": (lambda: changed(CLEAN, {("covariate", k): CLEAN.time for k in "ab"}), ("bias_covariate",)),
    "no north": (lambda: by_hand(12), ("magnetic_field",)),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_diagnosed_is_refused_in_one_sentence(name):
    made, baseline = REFUSED[name]
    with refused():
        diagnose([made()], baseline=baseline)


def test_a_law_that_reads_the_same_for_different_forces_is_refused():
    with refused():
        inverted(lambda f: 0 * f, np.ones((4, 3)))


def test_rows_are_listed_however_few():
    """Words for the rows that are off most, however few there are."""
    v = pointing(few_stars(4))
    assert largest_misfit_sentence(v, "across", 1.0, 2.0, np.array([2, 0, 1])).endswith("largest at stars 3, 1 and 2")
    assert largest_misfit_sentence(v, "across", 1.0, 2.0, np.array([1])).endswith("largest at stars 2")


@pytest.mark.parametrize("name", ["one row", "no force"])
def test_the_command_line_says_it_and_ends_with_status_2(name, tmp_path, monkeypatch, capsys):
    write(REFUSED[name][0](), tmp_path / "rec")
    monkeypatch.setattr("sys.argv", ["gimbalcal", "diagnose", str(tmp_path / "rec"), "--quiet"])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    shown = capsys.readouterr()
    assert stop.value.code == 2
    assert shown.out == ""
    assert shown.err.count("\n") == 1
    assert shown.err.startswith("gimbalcal: ")
