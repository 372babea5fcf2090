"""Gyroscopes reversed, exchanged or in another unit are named before a fit; what can be calibrated passes."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.checks.check import Examined, make_checks
from gimbalcal.checks.input_errors import PERMUTATIONS
from gimbalcal.checks.rates import CHECKS
from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH, known_platform
from gimbalcal.recording import Recording, Site
from gimbalcal.rotation import exponential
from gimbalcal.units import to_si
from tests.golden import golden_text

GRAVITY, STEP, REST, TURN = 9.8, 0.02, 25, 50
RATE, FORCE = "angular_rate", "specific_force"


def in_the_hand(rests=16, seed=0, latitude=None, level=1e-3):
    """Rests with turns of 30 to 150 deg about random axes between them; the Earth, and biases of 1 deg/s."""
    rng = np.random.default_rng(seed)
    C = exponential(rng.standard_normal(3))
    earth = EARTH_RATE * np.array([np.cos(latitude), 0, -np.sin(latitude)]) if latitude is not None else np.zeros(3)
    rates, forces, position = [], [], []
    for k in range(rests):
        n = TURN if k else 0
        axis = rng.standard_normal(3)
        turn = rng.uniform(0.5, 2.6) * axis / np.linalg.norm(axis)
        speed = 1 - np.cos(2 * np.pi * (np.arange(n) + 0.5) / max(n, 1))
        for s in (*speed, *np.zeros(REST)):
            w = turn * s / (TURN * STEP)
            C = exponential(w * STEP) @ C
            rates.append(w + C @ earth)
            forces.append(C @ np.array([0.0, 0.0, -GRAVITY]))
            position.append(k + 1 if s == 0 else 0)
    rate = np.array(rates) + level * rng.standard_normal((len(rates), 3)) + rng.uniform(-1, 1, 3) * np.radians(1.0)
    rate = rate @ (np.eye(3) + 0.03 * rng.standard_normal((3, 3)))
    force = np.array(forces) * (1 + 0.02 * rng.standard_normal(3)) + 0.03 * GRAVITY * rng.uniform(-1, 1, 3)
    channels: dict[tuple[str, str], Array] = {(RATE, a): rate[:, i] for i, a in enumerate("xyz")}
    channels |= {(FORCE, a): force[:, i] for i, a in enumerate("xyz")}
    units = {key: "rad/s" if key[0] == RATE else "m/s^2" for key in channels}
    return Recording("multi-position", "test", BENCH, Site(latitude, 0.0, GRAVITY), {},
                     STEP * np.arange(len(rate)), np.array(position), channels, units=units)  # fmt: skip


def changed(recording, M, quantity=RATE):
    """The same recording whose columns of a quantity hold M times what they should."""
    held = apply_matrix(M, recording.triad(quantity))
    channels = {**recording.channels, **{(quantity, a): held[:, i] for i, a in enumerate("xyz")}}
    return replace(recording, channels=channels)


def said(recording):
    with pytest.raises(InputError) as caught:
        make_checks(Examined(recording), CHECKS)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("seed", range(8))
def test_errors_that_a_calibration_takes_pass(seed):
    assert make_checks(Examined(in_the_hand(seed=seed)), CHECKS) == ()


@pytest.mark.parametrize("change", PERMUTATIONS[1:], ids=str)
def test_every_change_of_the_gyroscopes_is_found_again(change):
    message = said(changed(in_the_hand(), change.inverse().matrix))
    assert ("left-handed" in message) == (change.handed < 0)
    for a, b, s in zip("xyz", change.order, change.signs, strict=True):
        keys = [f'axis = "{a}"'] * ("xyz"[b] != a) + ["sign = -1"] * (s < 0)
        cure = f"for gyroscope {'xyz'[b]} write {', '.join(keys)}"
        assert cure in message or not keys or "write" in message.partition("accelerometer")[2]


def test_what_gravity_cannot_tell_apart_is_told_as_both():
    message = said(changed(in_the_hand(), np.diag([1.0, -1.0, 1.0]), FORCE))
    golden_text(message)


@pytest.mark.parametrize(("stated", "true"), [("rad/s", "deg/s"), ("deg/h", "rad/s"), ("deg/s", "deg/h")])
def test_units(stated, true):
    rows = changed(in_the_hand(), to_si(1.0, stated) / to_si(1.0, true) * np.eye(3))
    rows = replace(rows, units={key: stated if key[0] == RATE else u for key, u in rows.units.items()})
    golden_text(said(rows))


def test_a_clock_in_milliseconds():
    rows = in_the_hand()
    golden_text(said(replace(rows, time=1000 * rows.time)))


def test_one_gyroscope_alone_in_another_unit():
    message = said(changed(in_the_hand(), np.diag([1.0, 1.0, 180 / np.pi])))
    golden_text(message)


@pytest.mark.parametrize(
    ("M", "quantity"),
    [(np.diag([1, -1, 1]), RATE), (np.diag([1, 1, 180 / np.pi]), RATE), (np.diag([1, -1, 1]), FORCE)],
    ids=["sign", "unit", "sign of an accelerometer"],
)
def test_a_change_part_way(M, quantity):
    rows = in_the_hand()
    late = rows.time > rows.time[len(rows.time) // 2]
    then = changed(rows, M, quantity).channels
    golden_text(said(rows.with_channels({k: np.where(late, then[k], v) for k, v in rows.channels.items()})))


def test_a_unit_and_a_sign_together():
    message = said(changed(in_the_hand(), 180 / np.pi * np.diag([1.0, -1.0, 1.0])))
    golden_text(message)


@pytest.mark.parametrize("M", [np.eye(3), -np.eye(3)], ids=["right", "reversed"])
def test_counts_are_tried_too(M):
    raw = changed(in_the_hand(), 5000.0 * M)
    raw = replace(raw, units={key: "count" if key[0] == RATE else u for key, u in raw.units.items()})
    if M[0, 0] > 0:
        assert make_checks(Examined(raw), CHECKS) == ()
    else:
        golden_text(said(raw))


def test_turns_about_the_vertical_are_told_by_gimbals():
    n, rests = 40, 5
    position = np.repeat(np.tile([1, 0], rests), n)[: (2 * rests - 1) * n] * 1
    position = position * np.repeat(np.arange(2 * rests - 1) // 2 + 1, n)
    rate = np.where(position == 0, 2.0, 0.0)
    angle = np.cumsum(rate) * STEP
    channels = {(RATE, "x"): 0 * rate, (RATE, "y"): 0 * rate, (RATE, "z"): rate, ("gimbal_angle", "azimuth"): angle}
    table = known_platform("rate-table", "multi-position")
    channels = {(q, table.axis_names[0] if q == "gimbal_angle" else a): x for (q, a), x in channels.items()}
    right = Recording("multi-position", "test", table, Site(), {}, STEP * np.arange(len(rate)), position, channels)
    assert make_checks(Examined(right), CHECKS) == ()
    golden_text(said(changed(right, -np.eye(3))))


def test_nothing_is_refused_and_it_is_said_where_nothing_turns():
    still = in_the_hand()
    rows = (still.position is not None) & (still.position == 1)
    (sentence,) = make_checks(Examined(still.select(rows)), CHECKS)
    golden_text(sentence)


@pytest.mark.parametrize("M", [-np.eye(3), np.eye(3)[[1, 0, 2]], 3600.0 * np.eye(3)], ids=["signs", "order", "unit"])
def test_the_earth_at_rest_tells_where_no_turn_was_logged(M):
    whole = in_the_hand(latitude=np.radians(50.0), level=1e-7)
    rests = whole.select(np.asarray(whole.position) > 0)
    assert make_checks(Examined(rests), CHECKS) == ()
    golden_text(said(changed(rests, M)))


def test_accelerometers_that_are_all_reversed_show_only_in_the_earths_rate():
    seen = in_the_hand(latitude=np.radians(50.0), level=1e-7)
    message = said(changed(seen, -np.eye(3), FORCE))
    golden_text(message)
    assert make_checks(Examined(changed(in_the_hand(), -np.eye(3), FORCE)), CHECKS) == ()
