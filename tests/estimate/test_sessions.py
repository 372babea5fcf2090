"""Sessions of one unit: one recording of all, one calibration, and whether each of them agrees with the others."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import from_arrays
from gimbalcal.diagnose import diagnose
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.thermal import BiasDrift, BiasStep
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_at_rest
from gimbalcal.estimate.unit import unit_of_sessions
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, Source, dwell_means, dwells, join
from gimbalcal.rotation import exponential
from gimbalcal.units import to_si
from gimbalcal.views.turns import turns_between_rests
from tests.golden import golden_text, refused

G = 9.80665
BIAS = to_si(1.0, "mg") * np.array([12.0, -7.0, 3.0])
SCALE = np.array([4e-3, -2e-3, 1e-3])
LABELS = [f"{name}:{axis}" for name in ("scale_factor", "bias") for axis in "xyz"]


def session(seed, bias=BIAS, rests=14, moving=False, noise=2.0):
    """Rests in random attitudes, 30 rows each at 20 Hz, `noise` in mg; with `moving`, the turns between them too."""
    rng = np.random.default_rng(seed)
    C, force, rate, position = np.eye(3), [], [], []
    for k in range(rests):
        force += [C @ [0, 0, G]] * 30
        rate += [np.zeros(3)] * 30
        position += [k + 1] * 30
        w = rng.standard_normal(3)
        w *= rng.uniform(1.0, 2.5) / np.linalg.norm(w)
        for _ in range(20):
            C = exponential(w / 20) @ C
            force.append(C @ [0, 0, G])
            rate.append(w)
            position.append(0)
    f = (1 + SCALE) * np.array(force) + bias + to_si(noise, "mg") * rng.standard_normal((len(force), 3))
    w_all = 1.003 * np.array(rate) + 0.01 + 1e-3 * rng.standard_normal((len(rate), 3))
    channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
    if moving:
        channels |= {("angular_rate", a): w_all[:, i] for i, a in enumerate("xyz")}
    where = np.array(position)
    units = {key: "m/s^2" if key[0] == "specific_force" else "rad/s" for key in channels}
    source = (Source("samples.csv", str(seed)),)
    time = np.arange(len(f)) / 20
    made = Recording("multi-position", f"session {seed}", BENCH, Site(), {}, time, where, channels, source, units=units)
    return made if moving else made.select(where > 0)


def test_two_sessions_are_one_recording():
    a, b = session(1), session(2)
    both = join([a, b])
    assert [d.position for d in dwells(both)] == list(range(1, 29))
    assert np.all(np.diff(both.time) > 0)
    assert both.title == "session 1 and session 2"
    later = replace(b, time=b.time + 5e5)
    np.testing.assert_array_equal(join([a, later]).time, np.concatenate([a.time, later.time]))  # clocks that go on
    assert join([a]) is a


APART = "the time between sessions is that of their dates"
AT = 1.79e9  # s since 1970


@pytest.mark.parametrize(
    ("first", "second", "gap", "told"),
    [
        ({}, {}, None, "how long passed"),
        ({"date": "2026-11-01"}, {}, None, "how long passed"),
        ({"date": "2026-11-01"}, {"date": "2026-11-01"}, None, "how long passed"),
        ({"date": "2026-11-01"}, {"date": "2026-11-03"}, 2 * 86400.0, f"{APART}, which are good to a day"),
        ({"date": "2026-11-01T08:00"}, {"date": "2026-11-01T10:00+01:00"}, 3600.0, APART),
        ({"date": "2026-11-01T10:00"}, {"date": "2026-11-01T08:00"}, 7200.0, APART),  # the second came first
        ({"date": "2026-11-01T08:00:00"}, {"date": "2026-11-01T08:00:20"}, None, "how long passed"),  # at one time
        ({"epoch": AT}, {"epoch": AT + 86400.0}, 86400.0, APART),  # clocks of dates, each from its own midnight
        ({"at": AT}, {"at": AT + 500.0}, 500.0, APART),
        ({}, {"at": 500.0}, 500.0, "the sessions are on one clock"),
    ],
)
def test_how_far_apart_sessions_are(first, second, gap, told):
    at = (first.pop("at", 0.0), second.pop("at", 0.0))
    a, b = (replace(session(k), **said) for k, said in ((1, first), (2, second)))
    both = join([replace(r, time=r.time + t) for r, t in zip((a, b), at, strict=True)])
    later = len(a.time)  # both are as long
    assert both.remarks[-1].startswith(told)
    assert np.all(np.diff(both.time) > 0)
    assert (both.time[later] - both.time[0] == gap) == (gap is not None)
    assert both.restarts == (() if gap is not None else (both.time[later],))
    assert both.elapsed[later] == (gap or 0.0)
    assert len(stimulus_from_readings(dwell_means(both)).time) == 28


def test_clocks_of_dates_are_one_clock_each_from_its_own_midnight():
    def logged(seed, begin, zone):
        r = session(seed, rests=4)
        stamps = np.datetime64(begin) + (1e6 * r.time).round().astype("timedelta64[us]")
        at = np.array([f"{t}{zone}" for t in stamps])
        return from_arrays(at, specific_force=r.triad("specific_force"), position=r.position)

    evening, morning = logged(1, "2026-11-01T23:00:00.5", "Z"), logged(2, "2026-11-03T08:00:00.5", "+01:00")
    for both in (join([evening, morning]), join([morning, evening])):
        assert both.time[len(evening.time)] - both.time[0] == pytest.approx(32 * 3600.0)
        assert both.restarts == ()


def test_a_clock_begins_anew_in_each_session_of_an_unknown_time():
    a, b = session(1), session(2)
    means = dwell_means(join([a, b]))
    s, alone = stimulus_from_readings(means), stimulus_from_readings(dwell_means(b))
    np.testing.assert_allclose(s.time[14:], alone.time, atol=1e-6)
    assert np.all(np.diff(s.onwards) > 0)
    drift = BiasDrift(d=np.array([1.0, 0.0, 0.0])).contribution(s)[:, 0]
    np.testing.assert_allclose(drift[14:], alone.time, atol=1e-6)
    jump = BiasStep(J=np.array([1.0, 0.0, 0.0]), epoch=float(s.onwards[14]) - 1.0).contribution(s)[:, 0]
    np.testing.assert_array_equal(jump, np.arange(28) >= 14)  # which happens once


def test_a_gyroscope_has_a_bias_of_its_own_in_each_session():
    a, b = session(91, rests=10, moving=True), session(96, rests=10, moving=True)
    key = ("angular_rate", "y")
    off = b.with_channels({key: b.channels[key] + 3e-3})
    same, other = (view_at_rest(join([a, second])) for second in (b, off))
    assert same is not None
    assert other is not None
    misfit = [v.evaluate(()).residual[:, 1] for v in (same, other)]
    more = misfit[1] - misfit[0]
    assert more.mean() == pytest.approx(1.5e-3, rel=0.05)  # the mean of both
    assert abs(more[10:].mean() - more[:10].mean()) < 2e-4  # and no step of 3e-3 between them


def test_sessions_are_sharper_together_and_agree():
    recordings = [session(seed) for seed in (3, 4, 5)]
    made, alone = unit_of_sessions(recordings), multiposition(recordings[0])
    sigma, before = (dict(zip([p.label for p in c.parameters], c.sigmas, strict=True)) for c in (made, alone))
    assert 0.4 < np.mean([sigma[label] / before[label] for label in LABELS]) < 0.75  # 0.58 of a third
    x = dict(zip([p.label for p in made.parameters], made.values, strict=True))
    truth = np.concatenate([1 / (1 + SCALE) - 1, BIAS])
    assert np.all(np.abs([(x[n] - t) / sigma[n] for n, t in zip(LABELS, truth, strict=True)]) < 4)
    assert made.outcome == ""
    assert all(s["p_value"] > 1e-3 for s in made.provenance["options"]["sessions"])


def test_a_session_that_differs_is_named_with_the_constant():
    off = BIAS + to_si(1.0, "mg") * np.array([0.0, 8.0, 0.0])
    made = unit_of_sessions([session(6), session(7, off), session(8)])
    golden_text(made.outcome)
    assert made.stages[-2].name == "session 7 alone"


def test_nothing_turns_between_sessions():
    a, b = session(9, moving=True, rests=12), session(10, moving=True, rests=12)
    both = join([a.select(slice(None, -20)), b])  # the first ends at rest
    turns = turns_between_rests(both, multiposition(both))
    assert len(turns.level) == 24
    np.testing.assert_array_equal(turns.ends, [*range(1, 12), *range(13, 24)])
    options = unit_of_sessions([a, b]).provenance.options
    assert options.gyroscopes is None  # they were calibrated too
    assert all((s.p_value or 0.0) > 1e-3 for s in options.sessions or ())


def test_a_diagnosis_of_two_sessions_says_whether_they_agree():
    told = diagnose([session(11), session(12)], baseline=("bias", "scale_factor"))
    golden_text(told.in_words)
    off = diagnose([session(13), session(14, 3 * BIAS)], baseline=("bias", "scale_factor"))
    golden_text(off.in_words)
    named = {name for f in off.findings for name in (f["effect"], *f["twins"])}
    assert "bias_step" in named
    assert not {n for n in named if CATALOGUE[n].role.time_drift}  # no drift across a time that nobody recorded


@pytest.mark.parametrize(
    "change",
    [
        lambda r: replace(r, kind="rotation"),
        lambda r: replace(r, site=Site(None, 0.0, 9.79)),
        lambda r: replace(r, units=dict.fromkeys(r.units, "count")),
        lambda r: replace(r, source=session(15).source),
        lambda r: replace(r, position=None),
    ],
)
def test_what_is_no_second_session(change):
    with refused():
        join([session(15), change(session(16))])
