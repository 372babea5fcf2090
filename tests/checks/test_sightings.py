"""Readouts and stars of a mount along other axes, of other signs, in other units: named before a term is fitted."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.checks.table import refuse_implausible
from gimbalcal.number import Array
from tests.estimate.pointing.mounts import ALT_AZ, EQUATORIAL, effects, run, sky
from tests.golden import golden_text, refused

DEG = np.pi / 180
Change = Callable[[Array], Array]


def mount(platform):
    """A mount with errors of a degree and a zero of 40 deg, in deg."""
    inner, outer = platform.axis_names[:2]
    sizes = {f"gimbal_zero__{outer}": 144000.0, f"gimbal_zero__{inner}": 3600.0, "axis_collimation": -1600.0}
    made = run(platform, sky(platform), effects(platform, **sizes), noise=20.0)
    return replace(made, units=dict.fromkeys(made.channels, "deg"))


def changed(recording, quantity, axes, change):
    keys = [(quantity, recording.platform.axis_names[i]) for i in axes]
    return recording.with_channels({k: change(recording.channels[k]) for k in keys})


@pytest.mark.parametrize("platform", [ALT_AZ, EQUATORIAL], ids=lambda p: p.name)
def test_terms_of_a_degree_and_zeros_of_any_size_are_taken(platform):
    assert refuse_implausible(mount(platform)) == ()


@pytest.mark.parametrize("platform", [ALT_AZ, EQUATORIAL], ids=lambda p: p.name)
@pytest.mark.parametrize(
    ("quantity", "axes", "change"),
    [
        ("gimbal_angle", (1,), lambda x: -x),
        ("true_angle", (0,), lambda x: np.pi / 2 - x),
        ("gimbal_angle", (0, 1), lambda x: -x),
        ("gimbal_angle", (0, 1), lambda x: DEG * x),
        ("true_angle", (0, 1), lambda x: DEG * x),
        ("gimbal_angle", (1,), lambda x: x / 15),
        ("true_angle", (0, 1), lambda x: x / DEG),
        ("gimbal_angle", (0, 1), lambda x: np.roll(x, 7)),
    ],
)
def test_a_slip_is_named(platform, quantity, axes, change):
    with refused():
        refuse_implausible(changed(mount(platform), quantity, axes, change))


@pytest.mark.parametrize("quantity", ["gimbal_angle", "true_angle"])
def test_interchanged_axes_are_named(quantity):
    r = mount(ALT_AZ)
    a, b = ((quantity, axis) for axis in ALT_AZ.axis_names)
    with refused():
        refuse_implausible(r.with_channels({a: r.channels[b], b: r.channels[a]}))


def test_a_log_that_is_in_radians_altogether_is_asked_about():
    r = changed(
        changed(mount(ALT_AZ), "gimbal_angle", (0, 1), lambda x: DEG * x), "true_angle", (0, 1), lambda x: DEG * x
    )
    (said,) = refuse_implausible(r)
    golden_text(said)
    assert "radians" in said


def followed(step_deg, parked):
    """A mount that reads in steps and follows a source for an hour, and waits for it in a share of the rows."""
    t = np.arange(720.0)
    true = {"azimuth": np.radians(120 + 15 * t / 720), "elevation": np.radians(40 + 5 * t / 720)}
    waits = np.floor(t / 120) * 120
    at = np.where(t % 120 < parked * 120, waits, t).astype(int)
    read = {axis: np.radians(step_deg) * np.round(x[at] / np.radians(step_deg)) for axis, x in true.items()}
    made = mount(ALT_AZ)
    channels = {("gimbal_angle", a): x for a, x in read.items()} | {("true_angle", a): x for a, x in true.items()}
    return replace(made, time=5.0 * t, weight=np.ones(720), channels=channels, units=dict.fromkeys(channels, "deg"))


def test_a_mount_that_waits_for_its_source_has_no_sightings():
    with refused():
        refuse_implausible(followed(0.01, parked=0.9))


@pytest.mark.parametrize(("step", "parked"), [(0.01, 0.2), (0.3, 0.0), (1e-6, 0.0), (1.0, 0.0)])
def test_readouts_that_follow_in_coarse_steps_are_sightings(step, parked):
    assert refuse_implausible(followed(step, parked)) == ()
