"""Wrong axes, signs, units and clocks are named; small errors and mis-set positions are not refused."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.checks.table import refuse_implausible
from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.document import Document
from tests.golden import golden_text, refused

GRAVITY = 9.80146
FACES_AND_EDGES = np.radians(
    [[0, 0, 0], [0, 180, 0], [0, 90, 0], [0, -90, 0], [0, 0, 90], [0, 0, -90], [0, 45, 0], [0, 135, 0], [0, 0, 45],
     [0, 0, 135], [45, 90, 0], [135, 90, 0], [0, -45, 0], [0, 0, -45]]
)  # fmt: skip


def multi_position(noise=0.01):
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


def static_run():
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


def triad(recording, order, signs=(1, 1, 1), factor=1.0):
    """The same recording whose columns x, y, z hold what `order` and `signs` say."""
    held = {
        ("specific_force", a): s * factor * recording.channels["specific_force", o]
        for a, o, s in zip("xyz", order, signs, strict=True)
    }
    return recording.with_channels(held)


def from_the_middle(recording, order, signs):
    """The same recording whose columns are others in its second half."""
    changed, late = triad(recording, order, signs), np.arange(len(recording.time)) >= len(recording.time) // 2
    return recording.with_channels({k: np.where(late, changed.channels[k], v) for k, v in recording.channels.items()})


def angle(recording, change, only=""):
    return replace(
        recording,
        channels={
            (q, a): change(v) if q == "gimbal_angle" and only in ("", a) else v
            for (q, a), v in recording.channels.items()
        },
    )


def said(recording):
    with pytest.raises(InputError) as caught:
        refuse_implausible(recording)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("make", [multi_position, static_run])
def test_a_sound_recording_passes(make):
    refuse_implausible(make())


def test_two_interchanged_positions_are_left_to_the_estimators():
    rows = multi_position()
    order = np.arange(len(rows.time))
    order[[2, 7]] = [7, 2]
    forces = {key: v[order] if key[0] == "specific_force" else v for key, v in rows.channels.items()}
    refuse_implausible(replace(rows, channels=forces))


def test_poor_angles_pass():
    rng = np.random.default_rng(6)
    refuse_implausible(angle(multi_position(), lambda v: v + np.radians(3.0) * rng.standard_normal(v.shape)))


def test_counts_and_bare_units_are_not_judged():
    rows = triad(multi_position(), "yxz", (1, -1, 1), 4000.0)
    refuse_implausible(replace(rows, units=dict.fromkeys(rows.channels, "count")))
    without = {key: v for key, v in multi_position().channels.items() if key[0] == "specific_force"}
    refuse_implausible(triad(replace(multi_position(), channels=without, platform=BENCH), "yxz"))


def test_a_pause_in_a_static_run_is_no_jump():
    rows = static_run()
    kept = np.ones(144, dtype=bool)
    kept[30:100] = False
    refuse_implausible(rows.select(kept))


def unread(recording):
    return replace(recording, channels={k: v for k, v in recording.channels.items() if k[0] != "gimbal_angle"})


def interchanged_gimbals():
    rows = multi_position()
    inner, middle = rows.channels["gimbal_angle", "inner"], rows.channels["gimbal_angle", "middle"]
    swapped = {**rows.channels, ("gimbal_angle", "inner"): middle, ("gimbal_angle", "middle"): inner}
    return replace(rows, channels=swapped)


def unrelated_angles():
    rows, rng = multi_position(), np.random.default_rng(4)
    channels = {key: v[rng.permutation(len(v))] if key[0] == "gimbal_angle" else v for key, v in rows.channels.items()}
    return replace(rows, channels=channels)


def by_hand(axis, factor):
    """A unit in the hand, of which one accelerometer is in another unit."""
    rows = replace(multi_position(), platform=BENCH)
    channels = {k: v for k, v in rows.channels.items() if k[0] == "specific_force"}
    return replace(rows, channels={**channels, ("specific_force", axis): factor * channels["specific_force", axis]})


def at_temperature(degc, unit):
    r, key = multi_position(), ("temperature", "")
    return replace(r.with_channels({key: degc + 0 * r.time}), units={**r.units, key: unit})


def stepped_clock():
    return replace(static_run(), time=static_run().time + 900.0 * (np.arange(144) >= 70))


ORDERS = [("yxz", (1, 1, 1)), ("xzy", (1, 1, 1)), ("xyz", (-1, -1, -1)), ("xyz", (1, -1, 1)), ("xyz", (-1, 1, -1)),
          ("yxz", (1, 1, -1)), ("yzx", (1, 1, 1)), ("yxz", (1, -1, 1))]  # fmt: skip
CIRCLES = [("yxz", (1, 1, 1)), ("xzy", (1, 1, 1)), ("yzx", (1, 1, 1)), ("zxy", (1, 1, 1)), ("xyz", (1, 1, -1)),
           ("xyz", (1, -1, 1))]  # fmt: skip
PART_WAY = [("y reversed", multi_position, "xyz", (1, -1, 1)),
            ("x and z interchanged", multi_position, "zyx", (1, 1, 1)),
            ("x reversed in a static run", static_run, "xyz", (-1, 1, 1))]  # fmt: skip
FAULTS: dict[str, Recording] = {
    **{f"positions {o} {s}": triad(multi_position(), o, s) for o, s in ORDERS},
    **{f"static run {o} {s}": triad(static_run(), o, s) for o, s in ORDERS},
    **{f"static run without readouts {o} {s}": triad(unread(static_run()), o, s) for o, s in CIRCLES},
    "force in g": triad(multi_position(), "xyz", factor=1 / 9.80665),
    "one force in g": by_hand("y", 1 / 9.80665),
    "one force in mg": by_hand("z", 1e3 / 9.80665),
    "angles in radians": angle(multi_position(), np.radians),
    "angles that stand still": angle(multi_position(), np.zeros_like),
    "angle backwards": angle(multi_position(), np.negative, "inner"),
    "angles interchanged": interchanged_gimbals(),
    "angles unrelated": unrelated_angles(),
    "clock in minutes": replace(static_run(), time=static_run().time / 60),
    "platform angle backwards": angle(static_run(), np.negative, "platform"),
    "clock jumps": stepped_clock(),
    "angles in arcmin": angle(multi_position(), lambda v: v * 60),
    "zero of inner": angle(multi_position(), lambda v: v + np.pi / 2, "inner"),
    "zero of middle in a static run": angle(static_run(), lambda v: v + np.pi / 2, "middle"),
    **{f"{fault} from the middle on": from_the_middle(make(), o, s) for fault, make, o, s in PART_WAY},
    "wild readout": angle(static_run(), lambda v: v + np.radians(150.0) * (np.arange(144) == 70), "platform"),
    "kelvin called degC": at_temperature(295.0, "degC"),
    "600 K": at_temperature(600.0, "K"),
}


def test_what_is_refused_and_why(golden):
    golden("sentences/checks", "\n".join(f"{fault}: {said(recording)}" for fault, recording in FAULTS.items()))


def test_degrees_called_kelvin_are_questioned():
    golden_text(*refuse_implausible(at_temperature(-251.15, "K")))


@pytest.mark.parametrize(
    "recording", [unread(static_run()), unread(triad(static_run(), "xyz", (-1, -1, 1))), multi_position(), static_run()]
)
def test_what_physics_tells_or_cannot_tell_apart_passes_without_a_remark(recording):
    assert refuse_implausible(recording) == ()


def test_what_nothing_tells_is_said():
    (words,) = refuse_implausible(replace(unread(multi_position()), platform=BENCH))
    golden_text(words)
    (words,) = refuse_implausible(static_run().with_channels({("angular_rate", a): np.zeros(144) for a in "xyz"}))
    golden_text(words)


def test_running_motors_are_no_motion_and_a_turn_is():
    """Rests of 2 s at 100 Hz, shaken by 3 m/s^2 rms about their mean; and one within which the unit is turned over."""
    rng = np.random.default_rng(7)
    up = rng.standard_normal((9, 3))
    force = np.repeat(GRAVITY * up / np.linalg.norm(up, axis=1, keepdims=True), 200, axis=0)
    force = force + 3.0 * rng.standard_normal(force.shape)
    t, position = 0.01 * np.arange(len(force)), np.repeat(np.arange(1, 10), 200)

    def made(f):
        channels = {("specific_force", a): f[:, i] for i, a in enumerate("xyz")}
        return Recording("multi-position", "drone", BENCH, Site(None, 0.0, GRAVITY), {}, t, position, channels)

    refuse_implausible(made(force))
    force[100:200] *= -1
    with refused():
        refuse_implausible(made(force))


def test_positions_held_for_days_by_the_clock_are_asked_about():
    r = multi_position()
    rows = np.repeat(np.arange(14), 30)
    channels = {k: x[rows] for k, x in r.channels.items()}
    long = replace(r, time=1e5 * np.arange(420), position=rows + 1, channels=channels, weight=np.ones(420))
    golden_text(*refuse_implausible(long))
    assert not refuse_implausible(replace(long, time=long.time / 1e4))
    golden_text(*refuse_implausible(replace(long, time=long.time / 1e8)))


def test_thousands_of_dots_in_a_description_are_one_sentence(tmp_path):
    path = tmp_path / "recording.toml"
    path.write_text(f"format = 1\n[{'.'.join('a' * 3000)}]\n")
    with pytest.raises(InputError, match="beyond what TOML is for"):
        Document(path)


def long_dwells():
    """Dwells of 30 rows with the noise of 1e-4 m/s^2, one after the other."""
    r, rows = multi_position(), np.repeat(np.arange(14), 30)
    rng = np.random.default_rng(11)
    sigma = {"specific_force": 1e-4}
    channels = {k: x[rows] + sigma.get(k[0], 0.0) * rng.standard_normal(420) for k, x in r.channels.items()}
    scatter = {("specific_force", a): 1e-4 for a in "xyz"}
    time, position = 10.0 * np.arange(420), rows + 1
    return replace(r, time=time, position=position, channels=channels, weight=np.ones(420), scatter=scatter)


def test_columns_that_are_shifted_against_the_position_numbers_are_named():
    r = long_dwells()
    assert refuse_implausible(r) == ()
    late = r.with_channels({("specific_force", "x"): np.roll(r.channels["specific_force", "x"], 1)})
    golden_text(said(late))
    golden_text(said(replace(r, position=np.concatenate([r.position[:5], r.position[:-5]]))))


def test_steps_coarser_than_the_noise_are_remarked():
    r, key = long_dwells(), ("specific_force", "y")
    golden_text(*refuse_implausible(r.with_channels({key: np.round(r.channels[key] / 0.01) * 0.01})))
