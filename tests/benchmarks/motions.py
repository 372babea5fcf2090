"""True motions to try a calibration on: a unit at rest, the table swing and the vehicle run of Wang et al. (2019)."""

import numpy as np

from gimbalcal.earth import EARTH_RATE, G0
from gimbalcal.number import Array
from gimbalcal.rotation import frame_rotation
from tests.benchmarks.error_model import RADIUS, Trajectory

LATITUDE = np.deg2rad(32.0)  # Nanjing
# Table 5: frequency [Hz] and amplitude [rad] of heading, pitch and roll
SWING = ((2.0, np.deg2rad(3.0)), (2.0, np.deg2rad(3.0)), (8.0, np.deg2rad(5.0)))


def at_rest(hours: float, step: float = 1.0) -> Trajectory:
    """Level and still, pointing north."""
    time = np.arange(0.0, 3600 * hours + step / 2, step)
    return moved(time, np.zeros((len(time), 3)), np.zeros((len(time), 2)), np.zeros(len(time)))


def swing(seconds: float, step: float = 0.002, amplitude: float = 1.0) -> Trajectory:
    """Table 5: heading, pitch and roll swing together; `amplitude` scales all three."""
    time = np.arange(0.0, seconds + step / 2, step)
    angles = np.stack([amplitude * a * np.sin(2 * np.pi * f * time) for f, a in SWING], axis=-1)
    return moved(time, angles, np.zeros((len(time), 2)), np.zeros(len(time)))


def drive(hours: float = 3.2, step: float = 0.25) -> Trajectory:
    """A drive like section 5.2.3: legs between crossings, stops, hills; a quarter turn in 6 s at each crossing.

    The paper prints the route as a picture; this one has its length in time and its kinds of motion.
    """
    time = np.arange(0.0, 3600 * hours + step / 2, step)
    leg = 240.0  # s from crossing to crossing
    phase = time % leg
    speed = 15 * np.clip(phase / 20, 0, 1) * np.clip((leg - phase) / 20, 0, 1)  # stops at every crossing
    number = (time // leg).astype(int)
    senses = np.array([1, 1, -1, 1, -1, -1, 1, -1])  # a closed pattern of right and left turns
    turned = np.concatenate([[0], np.cumsum(senses[np.arange(number[-1] + 1) % 8])])
    share = np.clip((phase - 25) / 6, 0, 1)
    smooth = share**2 * (3 - 2 * share)  # rolling at full speed through the bend
    heading = np.pi / 2 * (turned[number] + (turned[number + 1] - turned[number]) * smooth)
    pitch = np.deg2rad(2) * np.sin(2 * np.pi * time / 600)
    angles = np.stack([heading, pitch, np.zeros_like(time)], axis=-1)
    return moved(time, angles, speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], -1), 0 * time)


def moved(time: Array, angles: Array, velocity: Array, height_rate: Array) -> Trajectory:
    """Force and rate of a body with heading, pitch, roll (n, 3) [rad] and velocity north, east (n, 2) [m/s]."""
    heading, pitch, roll = angles.T
    C_nb = frame_rotation("x", roll) @ frame_rotation("y", pitch) @ frame_rotation("z", heading)
    V = np.column_stack([velocity, -height_rate])
    north = np.concatenate([[0.0], np.cumsum((V[1:, 0] + V[:-1, 0]) / 2 * np.diff(time))])
    L = LATITUDE + north / RADIUS
    s, c, t = np.sin(L), np.cos(L), np.tan(L)
    zero = np.zeros_like(L)
    w_ie = EARTH_RATE * np.stack([c, zero, -s], axis=-1)
    w_en = np.stack([V[:, 1] / RADIUS, -V[:, 0] / RADIUS, -V[:, 1] * t / RADIUS], axis=-1)
    gravity = np.array([0.0, 0.0, G0])
    force_n = np.gradient(V, time, axis=0) + np.cross(2 * w_ie + w_en, V) - gravity
    dh, dp, dr = (np.gradient(x, time) for x in (heading, pitch, roll))
    body = np.stack([dr - dh * np.sin(pitch), dp * np.cos(roll) + dh * np.cos(pitch) * np.sin(roll),
                     dh * np.cos(pitch) * np.cos(roll) - dp * np.sin(roll)], axis=-1)  # fmt: skip
    turn = np.einsum("nij,nj->ni", C_nb, w_ie + w_en) + body
    force = np.einsum("nij,nj->ni", C_nb, force_n)
    return Trajectory(time, np.swapaxes(C_nb, -1, -2), V, force, turn, L)
