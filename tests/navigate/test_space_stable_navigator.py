"""The space-stable navigator against closed forms: Schuler, Foucault, the day, every source of error, energy, step.

The closed forms come from the equation of the error in axes that turn with the Earth, not from the program's inertial
ones. With x = (N, E, U) [m] the error of the place, u that of the velocity over ground and a (t) that of the force,

    x' = u - c1 U up,   u' = a - 2 W x u - (g/M N, g/N E, dg/dh U + dg/dL N/M) - c2 U up - k u_h + c1 U W x up,

which is linear, so that its answer to a = c e^{iwt} and c t e^{iwt} is exact algebra.
"""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE, normal_gravity, radii
from gimbalcal.navigate import space_stable_navigator
from gimbalcal.navigate.space_stable_navigator import Aids, InertialSite, navigate, schuler_rate, small_error_response

L = np.deg2rad(40.0)
SITE = InertialSite(L, 60.0, float(normal_gravity(L, 60.0)), 0.4)
M, N = (radius + SITE.height for radius in radii(L))
UP, NORTH, EAST = np.array([np.cos(L), 0, np.sin(L)]), np.array([-np.sin(L), 0, np.cos(L)]), np.array([0.0, 1.0, 0.0])
FREE, TIGHT = Aids(damping=0.0), Aids(damping=0.0, height_s=10.0)


def rows(hours, step):
    """Time since the beginning, and S, of rows in the middle of steps."""
    time = step * (np.arange(round(3600 * hours / step)) + 0.5)
    return time, SITE.phase + EARTH_RATE * (time - time[0])


def true_force(S):
    return SITE.gravity * np.stack([np.cos(L) * np.cos(S), np.cos(L) * np.sin(S), np.sin(L) + 0 * S], axis=-1)


def errors(hours, step, error=0.0, aids=FREE, **start):
    """North and east error (n, 2) [m] less what the step alone makes, 5 cm at 20 s."""
    time, S = rows(hours, step)
    c = navigate(time, true_force(S) + error, SITE, aids, **start)
    still = navigate(time, true_force(S), SITE, Aids(height_s=aids.height_s, damping=aids.damping))
    return np.stack([(c.latitude - still.latitude) * M, (c.phase - still.phase) * N * np.cos(L)], axis=-1)


def system(aids):
    """A of x' = A x + (0, 0, 0, a), x = N, E, U and their velocities."""
    k, g, T = 2 * aids.damping * schuler_rate(SITE), SITE.gravity, aids.height_s
    by_height = float(normal_gravity(L, 160.0) - normal_gravity(L, -40.0)) / 200
    by_latitude = float(normal_gravity(L + 1e-4, 60.0) - normal_gravity(L - 1e-4, 60.0)) / 2e-4
    c, s = EARTH_RATE * np.cos(L), EARTH_RATE * np.sin(L)
    W = np.array([[0, s, 0], [-s, 0, c], [0, -c, 0]])  # W x in N, E, U, where W = (c, 0, s) and N x E = -U
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[2, 2] = -2 / T
    A[3:, :3] = -np.array([[g / M, 0, 0], [0, g / N, 0], [by_latitude / M, 0, by_height + 1 / T**2 - by_height]])
    A[3:, 3:] = -2 * W - np.diag([k, k, 0])
    A[3:, 2] += 2 / T * W[:, 2]
    return A


def closed_form(time, c, aids, growing=False, start=(0.0, 0.0)):
    """North and east (n, 2) that answer Re sum c_k e^{ikwt}, or t times that, from rest or a velocity."""
    A, t = system(aids), time[:, None]
    particular, begin = np.zeros((len(time), 6), dtype=complex), np.zeros(6, dtype=complex)
    for k, a in c.items():
        w = 1j * k * EARTH_RATE
        R = np.linalg.inv(w * np.eye(6) - A)
        b = R @ np.concatenate([[0, 0, 0], a])
        once = R @ b
        particular += (t * b - once if growing else b) * np.exp(w * t)
        begin += -once if growing else b
    w, V = np.linalg.eig(A)
    free = np.linalg.solve(V, np.array([0, 0, 0, *start, 0]) - begin.real)
    return np.asarray((particular + (np.exp(np.outer(time, w)) * free) @ V.T).real[:, :2])


def harmonics(of_phase, step, orders=2):
    """Fourier coefficients of a force error in platform axes, a function of S, as N, E, U since the beginning."""
    S = SITE.phase - EARTH_RATE * step / 2 + 2 * np.pi * np.arange(8) / 8
    f = of_phase(S)
    x, y = np.cos(S) * f[:, 0] + np.sin(S) * f[:, 1], -np.sin(S) * f[:, 0] + np.cos(S) * f[:, 1]
    e = np.stack([x, y, f[:, 2]], axis=-1)
    a = np.stack([e @ NORTH, e @ EAST, e @ UP], axis=-1)
    spectrum = np.fft.fft(a, axis=0) / 8
    return {k: (1 if k == 0 else 2) * spectrum[k] for k in range(orders + 1)}


UG = 9.80665e-6
SOURCES = {
    "bias x": lambda S: 10 * UG * np.array([1.0, 0, 0]) + 0 * S[:, None],
    "bias y": lambda S: 10 * UG * np.array([0, 1.0, 0]) + 0 * S[:, None],
    "bias z": lambda S: 10 * UG * np.array([0, 0, 1.0]) + 0 * S[:, None],
    "scale factor x": lambda S: 1e-5 * true_force(S) * np.array([1.0, 0, 0]),
    "scale factor z": lambda S: 1e-5 * true_force(S) * np.array([0, 0, 1.0]),
    "misalignment xz": lambda S: 1e-5 * true_force(S)[:, [1]] * np.array([1.0, 0, 0]),
    "misalignment zx": lambda S: 1e-5 * true_force(S)[:, [0]] * np.array([0, 0, 1.0]),
    "platform turned": lambda S: -np.cross([1e-5, 2e-5, -1e-5], true_force(S)),
}


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("source", SOURCES)
def test_every_source_has_its_analytic_history(source, damping):
    (time, S), aids = rows(30, 20.0), Aids(damping=damping)
    made = errors(30, 20.0, SOURCES[source](S), aids)
    expected = closed_form(time, harmonics(SOURCES[source], 20.0), aids)
    assert np.abs(expected).max() > 30  # metres
    np.testing.assert_allclose(made, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_drift_grows_as_the_stars_leave_it(axis):
    rate = np.deg2rad(1e-3) / 3600 * np.eye(3)[axis]
    (time, S), aids = rows(30, 20.0), Aids(damping=0.3)

    def per_second(S):
        return -np.cross(rate, true_force(S))

    made = errors(30, 20.0, time[:, None] * per_second(S), aids)
    expected = closed_form(time, harmonics(per_second, 20.0), aids, growing=True)
    assert np.abs(expected).max() > 1500  # 0.001 deg/h is a nautical mile a day and more
    np.testing.assert_allclose(made, expected, atol=2e-3 * np.abs(expected).max())


def test_the_period_is_schulers():
    """84.4 min, from the whole plane of the swing, which Foucault's turn does not change."""
    made = errors(48, 10.0, start=(0.1, 0.0))
    energy = (made**2).sum(1)
    spectrum = np.abs(np.fft.rfft((energy - energy.mean()) * np.hanning(len(energy)), 16 * len(energy)))
    half = 1 / np.fft.rfftfreq(16 * len(energy), 10.0)[1000 + np.argmax(spectrum[1000:])]
    assert 2 * half / 60 == pytest.approx(84.4, abs=0.1)


def test_the_swing_turns_as_foucaults_pendulum():
    """A swing that began northwards turns its plane by w t sin L; in the closed form, and by its plane after 5 h."""
    (time, _), start = rows(6, 2.0), (0.1, 0.0)
    made = errors(6, 2.0, aids=TIGHT, start=start)
    np.testing.assert_allclose(made, closed_form(time, {}, TIGHT, start=start), atol=0.02)  # of 80 m
    last = time > time[-1] - 5064
    plane = np.linalg.eigh(np.cov(made[last].T))[1][:, -1]
    turned = np.arctan2(abs(plane[1]), abs(plane[0]))
    assert turned == pytest.approx(EARTH_RATE * (time[-1] - 2532) * np.sin(L), abs=0.03)


def test_the_undamped_swing_keeps_its_energy():
    """But for what the height's loop takes, as Coriolis' force makes the height swing along: 0.54 % a day at 10 s."""
    time, S = rows(24, 2.0)
    c = navigate(time, true_force(S), SITE, TIGHT, start=(0.1, 0.05))
    place = np.stack([(c.latitude - L) * M, (c.phase - S) * N * np.cos(L)], axis=-1)
    g = SITE.gravity
    energy = (c.velocity**2).sum(1) / 2 + g * place[:, 0] ** 2 / M / 2 + g * place[:, 1] ** 2 / N / 2
    taken = -2 * np.sort(np.linalg.eigvals(system(TIGHT)).real)[-4:].mean()
    assert taken * 86400 == pytest.approx(5.4e-3, rel=0.01)
    np.testing.assert_allclose(energy * np.exp(taken * time), energy[0], rtol=2e-3)


def test_halving_the_step_quarters_the_error():
    slow = Aids(damping=0.2, height_s=300.0)

    def at_six_hours(h):
        made = errors(7, h, 1e-4 * np.array([0, 0, 1.0]), slow)
        i = round(6 * 3600 / h)
        return (made[i - 1] + made[i]) / 2

    ends = [at_six_hours(h) for h in (60.0, 30.0, 15.0)]
    coarse, fine = np.linalg.norm(ends[0] - ends[1]), np.linalg.norm(ends[1] - ends[2])
    assert 3 < coarse / fine < 5


def test_a_perfect_navigator_stays_for_five_days():
    time, S = rows(120, 10.0)
    c = navigate(time, true_force(S), SITE)
    assert np.abs(c.latitude - L).max() * M < 0.02
    assert np.abs(c.phase - S).max() * N < 0.05
    assert np.abs(c.velocity).max() < 1e-4


def test_the_height_is_held():
    """A vertical force error a leaves a / (c2 - 2g/R) = a T^2, and an external height is followed."""
    time, S = rows(6, 10.0)
    up = np.stack([np.cos(L) * np.cos(S), np.cos(L) * np.sin(S), np.sin(L) + 0 * S], axis=-1)
    c = navigate(time, true_force(S) + 1e-4 * up, SITE, Aids(height_s=100.0))
    assert c.height[-1] - SITE.height == pytest.approx(1e-4 * 100**2, rel=0.01)
    c = navigate(time, true_force(S), SITE, Aids(height=np.where(time > 600, 12.0, 0.0)))
    held = 12 * (1 + 3.08e-6 * 100**2)  # the force stays that of the ground, gravity is less up there
    assert c.height[-1] == pytest.approx(SITE.height + held, abs=0.05)


def test_a_wrong_log_drives_the_place():
    """k v over g/R: the swing is pulled until gravity holds against the log."""
    made = errors(12, 10.0, aids=Aids(damping=0.5, velocity=(0.1, 0.0)))
    assert made[-1, 0] == pytest.approx(2 * 0.5 * 0.1 / schuler_rate(SITE), rel=0.02)


def test_rows_too_far_apart_are_refused():
    time, S = rows(6, 300.0)
    with pytest.raises(ValueError, match="height_s"):
        navigate(time, true_force(S), SITE)


@pytest.mark.parametrize(("damping", "lengths"), [(0.5, [10.0]), (0.0, [20.0]), (0.5, [5.0, 12.0, 7.0])])
def test_small_errors_all_at_once_are_what_each_does_alone(damping, lengths):
    """Half of what two navigations differ by, to the 5 cm by which the base itself is off its step, of the Earth."""
    aids = Aids(damping=damping)
    gaps = np.repeat(np.resize(lengths, 12), 250)
    time = np.append(0.0, np.cumsum(gaps))
    S = SITE.phase + EARTH_RATE * time
    still = true_force(S)
    slow = np.sin(EARTH_RATE * time)[:, None] * [2e-4, -1e-4, 3e-4]
    force = np.stack(
        [0 * still + [1e-4, 0, 0], 0 * still + [0, 0, 1e-4], 1e-5 * still[:, [1, 0, 2]], slow, 0 * still], -1
    )
    phase = np.array([0.0, 0.0, 1e-5, 0.0, -2e-5])
    d = small_error_response(time, force, phase, SITE, aids)
    for k in range(len(phase)):
        a, b = (
            navigate(time, still + way * force[..., k], replace(SITE, phase=SITE.phase + way * phase[k]), aids)
            for way in (1, -1)
        )
        for name in ("latitude", "phase", "velocity"):
            made, expected = getattr(d, name)[..., k], (getattr(a, name) - getattr(b, name)) / 2
            np.testing.assert_allclose(
                made, expected, atol=(1e-6 if len(lengths) == 1 else 3e-5) * np.abs(expected).max()
            )


def test_python_and_the_machine_march_alike():
    time, S = rows(12, 10.0)
    force = true_force(S) + 1e-4
    every = []
    for march in (space_stable_navigator._run_loop.loop, space_stable_navigator._run_loop.made()):
        out, (r, v) = np.empty((len(time), 5)), space_stable_navigator._at_rest(SITE, SITE.phase)
        aids = space_stable_navigator._loop_constants(SITE, Aids())
        end = march(np.full(len(time), 10.0), force, r, v, *aids, np.zeros((len(time), 2)),
                    np.full(len(time), SITE.height), out)  # fmt: skip
        every.append((out, np.array(end)))
    (python, end), (machine, same) = every
    np.testing.assert_allclose(python, machine, rtol=0, atol=1e-8)  # m: rounding of the Earth's radius
    np.testing.assert_allclose(end, same, rtol=1e-13)
