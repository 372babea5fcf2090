"""Shapes without a cause: each spans what its words say, in the channel that it names."""

import numpy as np
import pytest

from gimbalcal.diagnose.library.shapes import RIVAL_SIGMA, shapes_in_outputs
from gimbalcal.number import Array
from tests.diagnose.small import at_rest, observed

O = observed(1, dwell=6)
BLOCKS: list[Array] = [np.zeros((len(O.reduced(O.Z)), 1))]
FOUND = shapes_in_outputs(O, BLOCKS)
X = np.concatenate(BLOCKS, axis=1)


def rival(effect, axis):
    return next(c for c in FOUND if (c.effect, c.axis) == (effect, axis))


def left(rows, c):
    """Share of rows (R,) that no column of a variant of a shape can take."""
    out = []
    for v in c.variants:
        A = X[:, list(v.index)]
        out.append(np.linalg.norm(rows - A @ np.linalg.lstsq(A, rows, rcond=1e-10)[0]) / np.linalg.norm(rows))
    return float(min(out))


def along(axis, values):
    column = np.zeros((*O.residual.shape, 1))
    column[:, axis, 0] = values
    return O.reduced(column)[:, 0]


@pytest.mark.parametrize("axis", [0, 2])
def test_a_shape_spans_what_its_words_say(axis):
    s, name = O.view.stimulus, "xyz"[axis]
    scattered = np.random.default_rng(1).standard_normal(18)[s.position - 1]
    wave = np.cos(3 * np.pi * s.time / s.time[-1])
    u = s.force / s.gravity
    assert left(along(axis, scattered), rival("unknown position", name)) < 1e-3  # sensors lean and have scales
    assert left(along(axis, wave), rival("unknown time", name)) < 1e-3
    assert left(along(axis, u[:, 0] ** 2 * u[:, 1]), rival("unknown orientation", name)) < 1e-3
    assert left(along(axis, wave), rival("unknown time", "xyz"[axis - 1])) > 0.9  # of another channel
    assert left(along(axis, wave), rival("unknown orientation", name)) > 0.1  # 15 functions of 18 positions
    assert left(along(axis, wave), rival("unknown time", "x, y, z")) < 1e-3


def test_columns_are_of_one_size():
    """Rms of a row `RIVAL_SIGMA`, so that one prior of size suits all shapes."""
    for name in ("position", "time", "orientation"):
        for axis in "xyz":
            at = list(rival(f"unknown {name}", axis).variants[0].index)
            rms = np.sqrt((X[:, at] ** 2).sum(axis=0) / O.residual.shape[0])
            assert np.median(rms) == pytest.approx(RIVAL_SIGMA, rel=0.1)  # means of six rows keep nearly all of it


def test_shapes_have_words_and_no_parameters():
    assert len({(c.effect, c.axis) for c in FOUND}) == len(FOUND)
    for c in FOUND:
        assert c.rival
        assert c.parameters == ()
        assert c.effect.startswith("unknown ")
        assert not c.once
    assert {c.channel for c in FOUND if "gimbal" in c.effect} == {"gimbal_angle"}
    owned = sorted({i for c in FOUND for v in c.variants for i in v.index})
    assert owned == list(range(1, X.shape[1]))


def test_a_static_run_has_its_own():
    o = at_rest(1)
    blocks: list[Array] = [o.reduced(o.Z)]
    names = {c.effect for c in shapes_in_outputs(o, blocks)}
    assert "unknown position" not in names
    assert {"unknown time", "unknown orientation", "unknown temperature"} <= names
