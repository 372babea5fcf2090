"""A small recording of each kind, with everything logged that an effect may ask for, and effects sized for them."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, zero_effect
from gimbalcal.effects.effect import constants as constants_of
from gimbalcal.forward import angular_rate
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN
from gimbalcal.recording import Recording, Site
from gimbalcal.simulate import simulate


def scenario(kind: str) -> dict[str, Any]:
    """18 positions with five rows per dwell, or 24 h with a row every 25 minutes; the temperature wanders."""
    common: dict[str, Any] = {"format": 1, "kind": kind, "site": {"latitude": {"value": 40.0, "unit": "deg"}}}
    table = {"shape": "table", "time_h": [0.0, 0.4, 1.1, 1.9, 3.3, 30.0], "value": [19.0, 21.5, 20.2, 23.0, 18.0, 22.0]}
    if kind == "static-run":
        weather = {"shape": "random-walk", "mean": 20.0, "walk": 1.0}
        clock = {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 1500, "unit": "Hz"}}
        return common | {"schedule": clock, "environment": {"temperature": weather}}
    clock = {"name": "wu2018-18", "dwell": {"value": 10.0, "unit": "min"}, "rate": {"value": 1 / 120, "unit": "Hz"}}
    return common | {"schedule": clock, "environment": {"temperature": table}}


def recorded(kind: str) -> Recording:
    recording = simulate(scenario(kind))[0]
    walks = np.cumsum(np.random.default_rng(5).standard_normal((6, len(recording.time))), axis=1)
    return logged(recording, walks)


def logged(recording: Recording, slow: Array) -> Recording:
    """The recording with every covariate that an effect may name, from six random walks (6, n)."""
    names = ("supply_voltage", "pressure", "vibration", "servo_x", "servo_y", "servo_z")
    sizes = (0.02, 50.0, 0.3, 1e-6, 1e-6, 1e-6)
    channels = {("covariate", name): size * row for name, size, row in zip(names, sizes, slow, strict=True)}
    return recording.with_channels(channels)


def turning_table() -> Recording:
    """A three-axis table that swings about all its axes for two hours, a row every 24 s; it slowly warms."""
    platform, time = KNOWN["three-axis-table"], 24.0 * np.arange(300)
    rng = np.random.default_rng(7)
    angles = {name: A * np.sin(2 * np.pi * time / P + 1) for name, A, P in SWINGS}
    walks = np.cumsum(rng.standard_normal((7, len(time))), axis=1)
    channels = {("gimbal_angle", name): angle for name, angle in angles.items()} | {
        ("temperature", ""): 20 + walks[6] / 5
    }
    blank = Recording(
        kind="rotation", title="swings", platform=platform, site=Site(np.deg2rad(40.0), 0.0, G0), noise={}, time=time,
        position=None, channels=channels,
    )  # fmt: skip
    return logged(blank, walks[:6])


SWINGS = (("inner", 3.0, 400.0), ("middle", 2.0, 310.0), ("outer", 2.5, 530.0))  # rad, s: up to 3 deg/s


def night() -> Recording:
    """An alt-azimuth telescope that points at sixty stars in eight hours, between 15 and 80 degrees of elevation."""
    rng = np.random.default_rng(8)
    elevation, azimuth = rng.uniform(np.deg2rad(15), np.deg2rad(80), 60), rng.uniform(-np.pi, np.pi, 60)
    stars = {"elevation": elevation, "azimuth": azimuth}
    return Recording(
        kind="pointing", title="stars", platform=KNOWN["alt-az"], site=Site(np.deg2rad(40.0), 0.0, G0), noise={},
        time=np.linspace(0, 8 * 3600.0, 60), position=None,
        channels={(q, axis): angle for q in ("gimbal_angle", "true_angle") for axis, angle in stars.items()},
    )  # fmt: skip


RECORDINGS = {
    "multi-position": recorded("multi-position"),
    "static-run": recorded("static-run"),
    "rotation": turning_table(),
    "pointing": night(),
}


def experienced(kind: str) -> Stimulus:
    """The stimulus of a recording; where gyroscopes read, with the rates of its gimbals and of the Earth."""
    s = stimulus_from_angles(RECORDINGS[kind])
    if kind in {"static-run", "pointing"}:
        return s
    swing = np.zeros_like(s.readout)
    if kind == "rotation":
        swing = np.stack([A * 2 * np.pi / P * np.cos(2 * np.pi * s.time / P + 1) for _, A, P in SWINGS], axis=-1)
    return s.at(rate=angular_rate(RECORDINGS[kind].platform, s, (), swing))


def ready(name: str, kind: str = "multi-position") -> Effect:
    """The absent effect, and the channel named for those that take any covariate."""
    made = zero_effect(CATALOGUE[name], RECORDINGS[kind].platform.axis_names)
    given = {"covariate": "supply_voltage"} if any(f.name == "covariate" for f in fields(made)) else {}
    return replace(made, **given)


def unknowns(name: str, constants: bool = True, kind: str = "multi-position") -> tuple[Parameter, ...]:
    found = parameters(CATALOGUE[name], RECORDINGS[kind].platform.axis_names, constants=constants)
    grids = {f.name: f.metadata["grid"] for f in constants_of(CATALOGUE[name])}
    jumping = {field for field, g in grids.items() if g.counts or g.once}  # scanned, not differentiated
    return tuple(p for p in found if p.field not in jumping)
