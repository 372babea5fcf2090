"""Wrong axes, signs, units and clocks are named; small errors and mis-set positions are not refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.checks.table import refuse_implausible
from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.document import Document

GRAVITY = 9.80146
FACES_AND_EDGES = np.radians(
    [[0, 0, 0], [0, 180, 0], [0, 90, 0], [0, -90, 0], [0, 0, 90], [0, 0, -90], [0, 45, 0], [0, 135, 0], [0, 0, 45],
     [0, 0, 135], [45, 90, 0], [135, 90, 0], [0, -45, 0], [0, 0, -45]]
)  # fmt: skip


def multi_position(noise: float = 0.01) -> Recording:
    """14 positions of the space-stable platform, one row each, with errors of 10 mg."""
    angles = np.column_stack([FACES_AND_EDGES, np.zeros(len(FACES_AND_EDGES))])
    force = -GRAVITY * apply_matrix(SPACE_STABLE.attitude(angles), np.array([0.0, 0.0, 1.0]))
    force = force + noise * GRAVITY * np.random.default_rng(1).standard_normal(force.shape)
    n = len(angles)
    channels: dict[tuple[str, str], Array] = {("specific_force", a): force[:, i] for i, a in enumerate("xyz")}
    channels |= {("gimbal_angle", a): angles[:, i] for i, a in enumerate(("platform", "inner", "middle"))}
    units = {key: "m/s^2" if key[0] == "specific_force" else "deg" for key in channels}
    return Recording(
        "multi-position", "test", SPACE_STABLE, Site(None, 0.0, GRAVITY), {}, 120.0 * np.arange(n),
        np.arange(1, n + 1), channels, units=units,
    )  # fmt: skip


def static_run() -> Recording:
    """24 h at 40 N, each 10 min."""
    time = 600.0 * np.arange(144)
    phase, latitude = 1.0 + EARTH_RATE * time, np.radians(40.0)
    force = GRAVITY * np.array([np.cos(phase) * np.cos(latitude), np.sin(phase) * np.cos(latitude), 0 * phase])
    force[2] = GRAVITY * np.sin(latitude)
    channels: dict[tuple[str, str], Array] = {("specific_force", a): f for a, f in zip("xyz", force, strict=True)}
    channels |= {("gimbal_angle", "platform"): phase % (2 * np.pi), ("gimbal_angle", "middle"): 0 * phase + latitude}
    channels["gimbal_angle", "outer"] = 0 * phase
    return Recording(
        "static-run", "test", SPACE_STABLE_INERTIAL, Site(latitude, 0.0, GRAVITY), {}, time, None, channels
    )


def triad(recording: Recording, order: str, signs: tuple[int, int, int] = (1, 1, 1), factor: float = 1.0) -> Recording:
    """The same recording whose columns x, y, z hold what `order` and `signs` say."""
    held = {
        ("specific_force", a): s * factor * recording.channels["specific_force", o]
        for a, o, s in zip("xyz", order, signs, strict=True)
    }
    return replace(recording, channels={**recording.channels, **held})


def angle(recording: Recording, change: Callable[[Array], Array], only: str = "") -> Recording:
    return replace(
        recording,
        channels={
            (q, a): change(v) if q == "gimbal_angle" and only in ("", a) else v
            for (q, a), v in recording.channels.items()
        },
    )


def said(recording: Recording) -> str:
    with pytest.raises(InputError) as caught:
        refuse_implausible(recording)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("make", [multi_position, static_run])
def test_a_sound_recording_passes(make: Callable[[], Recording]) -> None:
    refuse_implausible(make())


@pytest.mark.parametrize("make", [multi_position, static_run])
@pytest.mark.parametrize(
    ("order", "signs", "words"),
    [
        ("yxz", (1, 1, 1), "the accelerometers x and y are interchanged"),
        ("xzy", (1, 1, 1), "the accelerometers y and z are interchanged"),
        (
            "xyz",
            (-1, -1, -1),
            "every accelerometer has the wrong sign (f = a - g: one whose axis points down reads -9.8",
        ),
        ("xyz", (1, -1, 1), "the accelerometer y had the opposite sign"),
        ("xyz", (-1, 1, -1), "the accelerometers x and z had the opposite sign"),
        (
            "yxz",
            (1, 1, -1),
            "the accelerometers x and y are interchanged and the accelerometer z had the opposite sign",
        ),
        ("yzx", (1, 1, 1), "the accelerometers called z, x, y are really x, y, z"),
    ],
)
def test_wrong_axes_and_signs_are_named(
    make: Callable[[], Recording], order: str, signs: tuple[int, int, int], words: str
) -> None:
    assert words in said(triad(make(), order, signs))


def test_force_in_g_called_si() -> None:
    message = said(triad(multi_position(), "xyz", factor=1 / 9.80665))
    assert "at rest the specific force is 1." in message or "at rest the specific force is 0.99" in message
    assert 'the numbers look like g: write unit = "g" of its columns' in message


def test_angles_in_radians_called_degrees() -> None:
    message = said(angle(multi_position(), np.radians))
    assert "all gimbal angles together turn by" in message
    assert 'so the angles look like radians; write unit = "rad" for the gimbal angles' in message


def test_readouts_that_stand_still() -> None:
    assert "the readouts are not those of the gimbals that moved" in said(angle(multi_position(), np.zeros_like))


def test_a_gimbal_that_counts_backwards() -> None:
    assert "if the inner angle has the opposite sign" in said(angle(multi_position(), np.negative, "inner"))


def test_interchanged_gimbals() -> None:
    rows = multi_position()
    inner, middle = rows.channels["gimbal_angle", "inner"], rows.channels["gimbal_angle", "middle"]
    swapped = {**rows.channels, ("gimbal_angle", "inner"): middle, ("gimbal_angle", "middle"): inner}
    message = said(replace(rows, channels=swapped))
    assert "interchanged" in message


def test_forces_that_follow_nothing() -> None:
    rows = multi_position()
    rng = np.random.default_rng(4)
    shuffled = {key: v[rng.permutation(len(v))] if key[0] == "gimbal_angle" else v for key, v in rows.channels.items()}
    message = said(replace(rows, channels=shuffled))
    assert "of what the gimbal angles predict, whichever axes or signs are changed; check the platform" in message


def test_two_interchanged_positions_are_left_to_the_estimators() -> None:
    rows = multi_position()
    order = np.arange(len(rows.time))
    order[[2, 7]] = [7, 2]
    forces = {key: v[order] if key[0] == "specific_force" else v for key, v in rows.channels.items()}
    refuse_implausible(replace(rows, channels=forces))


def test_poor_angles_pass() -> None:
    rng = np.random.default_rng(6)
    refuse_implausible(angle(multi_position(), lambda v: v + np.radians(3.0) * rng.standard_normal(v.shape)))


def test_counts_and_bare_units_are_not_judged() -> None:
    rows = triad(multi_position(), "yxz", (1, -1, 1), 4000.0)
    refuse_implausible(replace(rows, units=dict.fromkeys(rows.channels, "count")))
    without = {key: v for key, v in multi_position().channels.items() if key[0] == "specific_force"}
    refuse_implausible(triad(replace(multi_position(), channels=without, platform=BENCH), "yxz"))


def test_a_clock_that_jumps_in_a_static_run() -> None:
    rows = static_run()
    message = said(replace(rows, time=rows.time + 900.0 * (np.arange(144) >= 70)))
    assert (
        "between 41400 s and 42900 s the clock goes on by 1500 s while the platform gimbal turns by 2.507 deg"
        in message
    )
    assert "instead of 6.267 deg, so the clock jumps there" in message


def test_one_wild_readout_is_not_a_jump_of_the_clock() -> None:
    def wild(v: Array) -> Array:
        return np.asarray(v + np.radians(150.0) * (np.arange(144) == 70))

    message = said(angle(static_run(), wild, "platform"))
    assert "at 42000 s alone the platform gimbal reads 150 deg off its neighbours; leave this row out" in message


def test_a_pause_in_a_static_run_is_no_jump() -> None:
    rows = static_run()
    kept = np.ones(144, dtype=bool)
    kept[30:100] = False
    refuse_implausible(rows.select(kept))


@pytest.mark.parametrize(
    ("change", "rate"),
    [(lambda r: replace(r, time=r.time / 60), "902.46"), (lambda r: angle(r, np.negative, "platform"), "-15.041")],
)
def test_a_platform_that_does_not_follow_the_earth(change: Callable[[Recording], Recording], rate: str) -> None:
    message = said(change(static_run()))
    assert f"the platform gimbal turns by {rate} deg/h where the Earth turns by 15.041 deg/h" in message


@pytest.mark.parametrize(("axis", "factor", "unit"), [(1, 1 / 9.80665, "g"), (2, 1e3 / 9.80665, "mg")])
def test_one_accelerometer_of_a_unit_in_the_hand_in_another_unit(axis: int, factor: float, unit: str) -> None:
    rows = replace(multi_position(), platform=BENCH)
    channels = {k: v for k, v in rows.channels.items() if k[0] == "specific_force"}
    channels["specific_force", "xyz"[axis]] = factor * channels["specific_force", "xyz"[axis]]
    rows = replace(rows, channels=channels)
    message = said(rows)
    assert f'if accelerometer {"xyz"[axis]} alone were in {unit}; write unit = "{unit}" for it' in message


def test_what_to_write_for_an_exchange_and_a_sign() -> None:
    message = said(triad(multi_position(), "yxz", (1, -1, 1)))
    assert 'correct [columns]: for accelerometer y write axis = "x", sign = -1' in message
    assert "left-handed" in said(triad(multi_position(), "yxz"))


def unread(recording: Recording) -> Recording:
    return replace(recording, channels={k: v for k, v in recording.channels.items() if k[0] != "gimbal_angle"})


@pytest.mark.parametrize(
    ("order", "signs", "words"),
    [
        ("yxz", (1, 1, 1), "or the accelerometers x and y are interchanged; as stated they make a left-handed triad"),
        ("xzy", (1, 1, 1), "the accelerometers y and z are interchanged"),
        ("yzx", (1, 1, 1), "the accelerometers called z, x, y are really x, y, z"),
        ("zxy", (1, 1, 1), "the accelerometers called y, z, x are really x, y, z"),
        ("xyz", (1, 1, -1), "if the accelerometer z had the opposite sign, or every accelerometer has"),
        ("xyz", (1, -1, 1), "if the accelerometer y had the opposite sign, or the accelerometer x had"),  # any phase
    ],
)
def test_a_static_run_without_readouts_circles_the_earth(order: str, signs: tuple[int, int, int], words: str) -> None:
    assert words in said(triad(unread(static_run()), order, signs))


@pytest.mark.parametrize(
    "recording", [unread(static_run()), unread(triad(static_run(), "xyz", (-1, -1, 1))), multi_position(), static_run()]
)
def test_what_physics_tells_or_cannot_tell_apart_passes_without_a_remark(recording: Recording) -> None:
    assert refuse_implausible(recording) == ()


def test_what_nothing_tells_is_said() -> None:
    (words,) = refuse_implausible(replace(unread(multi_position()), platform=BENCH))
    assert words.startswith("order and signs of the accelerometers were not checked")
    (words,) = refuse_implausible(replace(static_run(), channels={**static_run().channels,
                                  **{("angular_rate", a): np.zeros(144) for a in "xyz"}}))  # fmt: skip
    assert words == "the gyroscopes of a static run are not looked at"


def test_running_motors_are_no_motion_and_a_turn_is() -> None:
    """Rests of 2 s at 100 Hz, shaken by 3 m/s^2 rms about their mean; and one within which the unit is turned over."""
    rng = np.random.default_rng(7)
    up = rng.standard_normal((9, 3))
    force = np.repeat(GRAVITY * up / np.linalg.norm(up, axis=1, keepdims=True), 200, axis=0)
    force = force + 3.0 * rng.standard_normal(force.shape)
    t, position = 0.01 * np.arange(len(force)), np.repeat(np.arange(1, 10), 200)

    def made(f: Array) -> Recording:
        channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
        return Recording("multi-position", "drone", BENCH, Site(None, 0.0, GRAVITY), {}, t, position, channels)

    refuse_implausible(made(force))
    force[100:200] *= -1
    with pytest.raises(InputError, match=r"within position 1, .* so this is no rest"):
        refuse_implausible(made(force))


@pytest.mark.parametrize(("degc", "unit", "words"), [(295.0, "degC", 'write unit = "K"'), (600.0, "K", "correct it")])
def test_temperatures_at_which_no_sensor_works_are_refused(degc: float, unit: str, words: str) -> None:
    r = multi_position()
    key = ("temperature", "")
    hot = replace(r, channels={**r.channels, key: degc + 0 * r.time}, units={**r.units, key: unit})
    assert words in said(hot)


def test_degrees_called_kelvin_are_asked_about() -> None:
    r = multi_position()
    key = ("temperature", "")
    cold = replace(r, channels={**r.channels, key: 22.0 - 273.15 + 0 * r.time}, units={**r.units, key: "K"})
    assert any("the numbers look like degC" in told for told in refuse_implausible(cold))


def test_positions_held_for_days_by_the_clock_are_asked_about() -> None:
    r = multi_position()
    rows = np.repeat(np.arange(14), 30)
    channels = {k: x[rows] for k, x in r.channels.items()}
    long = replace(r, time=1e5 * np.arange(420), position=rows + 1, channels=channels, weight=np.ones(420))
    assert any("is that so? if the time is in ms" in told for told in refuse_implausible(long))
    assert not refuse_implausible(replace(long, time=long.time / 1e4))
    assert any(
        "if the time is in s, or in min" in said for said in refuse_implausible(replace(long, time=long.time / 1e8))
    )


def test_thousands_of_dots_in_a_description_are_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "recording.toml"
    path.write_text(f"format = 1\n[{'.'.join('a' * 3000)}]\n")
    with pytest.raises(InputError, match="beyond what TOML is for"):
        Document(path)
