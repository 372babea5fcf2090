"""A strapdown unit in its place against closed forms: Schuler, Foucault, the day, its alignment, halved steps, bands.

The closed forms are exponentials of the textbook's equation of small errors, computed minus true, in north, east, down
with the height held, x = (r_N, r_E, v_N, v_E, phi_N, phi_E, phi_D); the program has the full mechanisation.
"""

from functools import cache

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.earth import EARTH_RATE, NAUTICAL_MILE, normal_gravity
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.navigate.navigation_errors import Navigated
from gimbalcal.navigate.space_stable_navigator import Aids, InertialSite, schuler_rate
from gimbalcal.navigate.strapdown import aided_strapdown, radii
from gimbalcal.navigate.strapdown_unit import aligned_attitude, thinned_intervals
from gimbalcal.navigate.uncertainty import before_and_after, navigation_errors, sigma_bands, usual_references
from gimbalcal.recording import read, write
from gimbalcal.rotation import exponential
from gimbalcal.simulate import simulate
from tests.golden import refused

L = np.deg2rad(40.0)
SITE = InertialSite(L, 60.0, float(normal_gravity(L, 60.0)), 0.0)
M, N = radii(np.sin(L), SITE.height)
EARTH = EARTH_RATE * np.array([np.cos(L), 0.0, -np.sin(L)])
UP = np.array([0.0, 0.0, -SITE.gravity])
AT = np.array([L, 0.0, SITE.height])
UG, DEG_H = 9.80665e-6, np.deg2rad(1.0) / 3600
PLACE = {"latitude": {"value": 40.0, "unit": "deg"}, "height": {"value": 60.0, "unit": "m"}}
UNIT = {
    "bias": {"x": 60.0, "y": -80.0, "z": 50.0}, "gyro_bias": {"x": 0.004, "y": -0.006, "z": 0.005},
    "scale_factor": {"z": 40.0}, "gyro_scale_factor": {"x": 50.0}, "misalignment": {"xz": 5.0, "yz": -4.0},
}  # fmt: skip


def textbook(damping=0.0):
    """F (7, 7)."""
    F, s, c = np.zeros((7, 7)), EARTH_RATE * np.sin(L), EARTH_RATE * np.cos(L)
    F[0, 2] = F[1, 3] = 1
    F[2, 5], F[3, 4] = SITE.gravity, -SITE.gravity
    F[2, 3], F[3, 2] = -2 * s, 2 * s
    F[2, 2] = F[3, 3] = -2 * damping * schuler_rate(SITE)
    F[4, 5], F[5, 4], F[5, 6], F[6, 5] = -s, s, c, -c  # phi x Earth's rate
    F[4, 0], F[6, 0] = -s / M, -c / M
    F[4, 3], F[5, 2], F[6, 3] = 1 / N, -1 / M, -np.tan(L) / N
    return F


def grown(hours, u, start, damping=0.0, step=10.0):
    """Position north and east (n, 2) [m] at multiples of the step."""
    from scipy.linalg import expm

    A = np.zeros((8, 8))
    A[:7, :7], A[:7, 7] = textbook(damping), u
    over, x = expm(A * step), np.append(start, 1.0)
    out = []
    for _ in range(round(3600 * hours / step)):
        x = over @ x
        out.append(x[:2])
    return np.array(out)


def at_rest(hours, force, rate, phi, damping=0.0, step=10.0, start=None):
    """The same of the navigator, a level unit pointing north, with sensor errors and errors of attitude at first."""
    n = round(3600 * hours / step)
    made = aided_strapdown(
        np.full(n, step), np.tile(EARTH + rate, (n, 1)), np.tile(UP + force, (n, 1)), exponential(phi), AT,
        np.arange(n), 2 * damping * schuler_rate(SITE), 10.0, SITE.gravity, start,
    )  # fmt: skip
    return np.asarray((made.position[1:, :2] - AT[:2]) * [M, N * np.cos(L)])


SOURCES = [("bias", i) for i in range(2)] + [("drift", i) for i in range(3)] + [("attitude", i) for i in range(3)]


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize(("source", "axis"), SOURCES)
def test_every_source_has_its_analytic_history(source, axis, damping):
    one = np.eye(3)[axis]
    force, rate, phi = 10 * UG * one * (source == "bias"), 0.002 * DEG_H * one * (source == "drift"), np.zeros(3)
    phi = 5e-5 * one if source == "attitude" else phi
    u = np.concatenate([[0, 0], force[:2], -rate])
    expected = grown(30, u, np.concatenate([np.zeros(4), phi]), damping)
    assert np.abs(expected).max() > 50  # metres
    np.testing.assert_allclose(at_rest(30, force, rate, phi, damping), expected, atol=4e-3 * np.abs(expected).max())


def test_it_swings_with_schuler_turned_by_foucault_and_with_the_day():
    """The equation has no other periods than these, and the navigator none besides."""
    w = np.sort(np.linalg.eigvals(textbook()).imag)[-3:]
    between = np.sqrt(SITE.gravity / M) - np.sqrt(SITE.gravity / N)  # a swing north is slower than one east
    np.testing.assert_allclose(w[0], EARTH_RATE, rtol=3e-3)
    np.testing.assert_allclose((w[1] + w[2]) / 2, np.hypot(schuler_rate(SITE), EARTH_RATE * np.sin(L)), rtol=1e-4)
    np.testing.assert_allclose(w[2] - w[1], np.hypot(2 * EARTH_RATE * np.sin(L), between), rtol=5e-3)
    made = at_rest(72, np.array([10 * UG, -5 * UG, 0]), DEG_H * np.array([1e-3, 2e-3, -1e-3]), np.zeros(3))
    t = 10.0 * np.arange(1, len(made) + 1)
    basis = np.stack([np.ones_like(t), t, *(f(x * t) for x in w for f in (np.cos, np.sin))], axis=-1)
    left = made - basis @ np.linalg.lstsq(basis, made, rcond=None)[0]
    assert np.abs(left).max() < 2e-3 * np.abs(made).max()


def test_halving_the_step_quarters_the_error():
    start = np.array([0.3, 0.2, 0.0])
    fine = at_rest(6, np.zeros(3), np.zeros(3), np.zeros(3), step=1.25, start=start)
    off = []
    for step in (10.0, 5.0):
        made = at_rest(6, np.zeros(3), np.zeros(3), np.zeros(3), step=step, start=start)
        several = round(step / 1.25)
        off.append(np.abs(made - fine[several - 1 :: several]).max())
    assert 3.0 < off[0] / off[1] < 5.0
    assert off[0] < 0.02 * np.abs(fine).max()


def test_the_height_stays_where_the_external_one_is():
    """Left alone it doubles every seven minutes: 10 ug would be 100 km in six hours."""
    n = 2160
    heavy = UP + np.array([0.0, 0.0, 10 * UG])
    readings = np.full(n, 10.0), np.tile(EARTH, (n, 1)), np.tile(heavy, (n, 1))
    made = aided_strapdown(*readings, np.eye(3), AT, np.arange(n), 0.0, 100.0, SITE.gravity)
    assert np.abs(made.position[:, 2] - SITE.height).max() < 2.0  # 10 ug times the square of 100 s


def test_alignment_hides_what_it_can():
    """Level by the accelerometers, north by the east gyroscope: phi_E = -df_N/g, phi_N = df_E/g, phi_D by the rest."""
    n, force, rate = 60, UG * np.array([100.0, -60.0, 0.0]), DEG_H * np.array([0.0, 0.01, 0.0])
    C = aligned_attitude(
        np.full(n, 1.0), np.tile(EARTH + rate, (n, 1)), np.tile(UP + force, (n, 1)), SITE, Aids(damping=0.0)
    )
    phi = np.array([C[1, 2] - C[2, 1], C[2, 0] - C[0, 2], C[0, 1] - C[1, 0]]) / 2  # C = 1 - [phi x]
    level = np.array([force[1], -force[0]]) / SITE.gravity
    north = (rate[1] + EARTH[2] * level[0]) / EARTH[0]
    np.testing.assert_allclose(phi, [*level, north], atol=5e-7)


def run(truth, hours=12.0, **schedule):
    motion = {"start": {"x": "east", "y": "north", "z": "up"}, "dwell": {"value": hours, "unit": "h"},
              "start_sigma": {"value": 0.3, "unit": "deg"}, "rate": {"value": 0.1, "unit": "Hz"}}  # fmt: skip
    return simulate(
        {"format": 1, "kind": "rotation", "site": PLACE, "truth": truth, "schedule": {**motion, **schedule}}
    )


@cache
def unit():
    return run(UNIT)


def calibration(effects, wanted=(), sigma=0.0):
    variance = [(sigma * p.sigma) ** 2 for p in wanted]
    return Calibration("test", effects, wanted, np.diag(variance), (), Residual(0, 0, {}))


def test_the_truth_taken_off_leaves_nothing():
    made, effects = unit()
    before, after = before_and_after(made, [("truth", calibration(effects))], usual_references(made))
    assert before.position.max() > NAUTICAL_MILE
    assert after.position.max() < 0.01
    assert after.mechanisation == "strapdown"
    assert np.isfinite(after.error).all()


@pytest.mark.parametrize("rate", [100.0, 25.0])
def test_a_unit_that_swings_is_aligned_and_navigated_all_the_same(rate):
    """2, 2 and 8 Hz in half a minute of alignment and two of navigation; fourth order in the step."""
    axis = {"frequency": {"value": 2.0, "unit": "Hz"}, "amplitude": {"value": 3.0, "unit": "deg"}}
    fast = {"frequency": {"value": 8.0, "unit": "Hz"}, "amplitude": {"value": 0.5, "unit": "deg"}}
    swing = {"heading": axis, "pitch": axis, "roll": fast}
    made, _ = simulate({
        "format": 1, "kind": "rotation", "site": PLACE, "schedule": {
            "swing": swing, "duration": {"value": 150, "unit": "s"}, "rate": {"value": rate, "unit": "Hz"}
        }})  # fmt: skip
    found = navigation_errors(made, None, Aids(damping=0.0, alignment=30.0))
    assert found.position.max() < {100.0: 0.05, 25.0: 5.0}[rate]
    assert np.isnan(found.error[:, 4:]).all()  # nobody knows how it truly stands


def test_a_unit_that_turns_is_navigated_row_by_row_and_at_rest_in_means():
    turns = [{"axis": a, "angle": {"value": b, "unit": "deg"}} for a, b in (("z", 180), ("x", 180), ("z", -180))]
    made, _ = run({}, moves=turns, dwell={"value": 300, "unit": "s"}, rate={"value": 20.0, "unit": "Hz"})
    legs = thinned_intervals(made, 10.0)
    assert len(legs.dt) < 0.2 * len(made.time)
    assert not legs.steady
    np.testing.assert_allclose(legs.dt.sum(), len(made.time) / 20.0)
    begin = made.time[0] - 1 / 20.0
    np.testing.assert_allclose(legs.rows.time - begin, np.cumsum(legs.dt) - legs.dt / 2, atol=1e-6)
    assert navigation_errors(made, None, Aids(damping=0.0, alignment=200.0)).position.max() < 3.0


def test_bands_by_propagation_and_by_samples_agree():
    made, effects = unit()
    wanted = tuple(p for e in ("bias", "gyro_bias") for p in parameters(CATALOGUE[e], ()))
    known = calibration(effects, wanted, 1e-3)
    (_, linear), (_, sampled) = sigma_bands(made, known, usual_references(made), 60, 3)
    ratio = sampled.max(0) / linear.max(0)
    assert np.all(np.abs(ratio - 1) < 3 / np.sqrt(2 * 60)), ratio


def test_pauses_of_a_unit_at_rest_are_filled_and_those_of_one_that_turns_refused():
    made, _ = unit()
    whole = navigation_errors(made, None, usual_references(made))
    kept = np.ones(len(made.time), dtype=bool)
    kept[1000:1200] = False
    holed = navigation_errors(made.select(kept), None, usual_references(made))
    assert holed.time[-1] == pytest.approx(whole.time[-1], abs=20)
    assert holed.position[-1] == pytest.approx(whole.position[-1], rel=0.01)
    turns = [{"axis": "z", "angle": {"value": 180, "unit": "deg"}}]
    turned, _ = run({}, moves=turns, dwell={"value": 300, "unit": "s"}, rate={"value": 5.0, "unit": "Hz"})
    lost = np.ones(len(turned.time), dtype=bool)
    lost[1510:1530] = False
    with refused():
        navigation_errors(turned.select(lost), None, Aids(alignment=200.0))


def test_what_cannot_be_navigated_is_refused():
    from dataclasses import replace

    made, _ = unit()
    without = {k: v for k, v in made.channels.items() if k != ("angular_rate", "y")}
    for wrong in (
        replace(made, site=replace(made.site, latitude=None)),
        replace(made, channels=without),
        made.select(slice(0, 30)),
    ):
        with refused():
            navigation_errors(wrong, None, usual_references(wrong))


def test_errors_are_told_from_the_end_of_the_alignment():
    made, _ = unit()
    found: Navigated = navigation_errors(made, None, Aids(damping=0.0, alignment=3600.0))
    assert found.time[0] == 0
    assert found.time[-1] == pytest.approx(11 * 3600, abs=20)
    assert found.position[0] < 1e-6  # m


def driven(truth, **more):
    motion = {"drive": {"speed": {"value": 15, "unit": "m/s"}, "pitch": {"value": 2, "unit": "deg"},
                        "rest": {"value": 300, "unit": "s"}},
              "duration": {"value": 0.75, "unit": "h"}, "rate": {"value": 10, "unit": "Hz"}}  # fmt: skip
    return simulate({"format": 1, "kind": "rotation", "site": PLACE, "truth": truth, "schedule": motion, **more})


def test_a_vehicle_is_held_against_its_reference():
    """Ten legs with bends and hills: the simulated motion and the navigator know nothing of each other."""
    made, _ = driven({})
    found = navigation_errors(made, None, Aids(damping=0.0, alignment=240.0))
    assert found.position.max() < 0.2  # m, of 20 km
    assert np.isnan(found.error[:, 2:]).all()
    made, effects = driven({"bias": {"x": 500.0}, "quadratic_nonlinearity": {"z": 300.0}})
    before, after = before_and_after(made, [("truth", calibration(effects))], Aids(damping=0.0, alignment=240.0))
    assert before.position.max() > 100 * after.position.max()


def test_the_place_of_a_vehicle_is_written_and_read(tmp_path):
    made, _ = driven({}, noise={"accelerometer": {"value": 50.0, "unit": "ug"},
                                "gyroscope": {"value": 5.0, "unit": "deg/h"}})  # fmt: skip
    write(made, tmp_path / "drive", "samples.csv")
    back = read(tmp_path / "drive")
    for quantity, size in (("latitude", 1e-12), ("longitude", 1e-12), ("height", 1e-6)):
        np.testing.assert_allclose(back.channels[quantity, ""], made.channels[quantity, ""], atol=size)


def test_readings_of_an_instant_are_corrected_before_they_are_means():
    """What bends with the square of a rate does so with that of the instant: 0.1 deg/s of a swing are rectified."""
    fast = {"frequency": {"value": 8.0, "unit": "Hz"}, "amplitude": {"value": 2.0, "unit": "deg"}}
    made, effects = simulate({
        "format": 1, "kind": "rotation", "site": PLACE, "truth": {"gyro_scale_nonlinearity": {"x": 2000.0}},
        "schedule": {"swing": {"roll": fast}, "duration": {"value": 90, "unit": "s"}, "rates": "instant",
                     "rate": {"value": 200.0, "unit": "Hz"}}})  # fmt: skip
    before, after = before_and_after(made, [("truth", calibration(effects))], Aids(damping=0.0, alignment=30.0))
    assert before.position.max() > 1000 * after.position.max()
