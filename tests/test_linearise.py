"""Derivatives stage by stage are those of the whole model, whichever effects are there."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, Stage, parameters, values, with_values, zero_effect
from gimbalcal.forward import jacobian, linearise, predict
from gimbalcal.number import STEP
from gimbalcal.platform import KNOWN
from tests.test_effects_contract import RECORDINGS, rich

KINDS = ("multi-position", "rotation", "static-run", "pointing")


def recording_of(kind):
    if kind == "pointing":
        return replace(RECORDINGS["multi-position"], platform=KNOWN["alt-az"], kind=kind)
    return replace(RECORDINGS["static-run" if kind == "static-run" else "multi-position"], kind=kind)


def whole(kind, effects, wanted):
    """The complex step through `predict`, one parameter at a time."""
    made, s = recording_of(kind), stimulus_of(kind)
    x0, columns = values(effects, wanted), []
    for unit in np.eye(len(wanted)):
        nudged = with_values(effects, wanted, x0 + 1j * STEP * unit, s.axis_names)
        columns.append({k: v.imag / STEP for k, v in predict(made.platform, s, nudged, kind).items()})
    return {k: np.stack([c[k] for c in columns], axis=-1) for k in columns[0]}


def stimulus_of(kind):
    s = rich("static-run" if kind == "static-run" else "multi-position")
    if kind != "pointing":
        return s
    names = KNOWN["alt-az"].axis_names
    cut = {f.name: getattr(s, f.name)[:, :2] for f in fields(s) if f.name in ("readout", "angle", "move_angle", "load")}
    directions = tuple(a.direction for a in KNOWN["alt-az"].axes)
    angle = np.random.default_rng(3).uniform(0.3, 1.2, cut["readout"].shape)
    cut |= {"readout": angle, "angle": angle, "true_angle": angle + 1e-3}
    return s.at(**cut, axis_names=names, axis_directions=directions, sense=())


def filled(name, kind, share=0.3):
    names = recording_of(kind).platform.axis_names
    made = zero_effect(CATALOGUE[name], names)
    if any(f.name == "covariate" for f in fields(made)):
        made = replace(made, covariate="supply_voltage")
    wanted = parameters(CATALOGUE[name], names)
    return with_values([made], wanted, share * np.array([p.sigma for p in wanted]), names)[0]


@pytest.mark.parametrize("spanning", ["", *(n for n in CATALOGUE if CATALOGUE[n].spans_rows)])
@pytest.mark.parametrize("kind", KINDS)
def test_stage_by_stage_is_the_whole_model(kind, spanning):
    """Every effect is there, derivatives by each; effects that span rows one at a time."""
    made, s = recording_of(kind), stimulus_of(kind)
    names = [n for n in sorted(CATALOGUE) if kind in CATALOGUE[n].kinds]
    if spanning and spanning not in names:
        pytest.skip(f"{spanning} does not show in a {kind} recording")
    there = [filled(n, kind, 0.0 if CATALOGUE[n].spans_rows and n != spanning else 0.3) for n in names]
    wanted = [parameters(CATALOGUE[n], s.axis_names)[-1] for n in names]
    stages, full = jacobian(made.platform, s, there, wanted, kind), whole(kind, there, wanted)
    assert stages.keys() == full.keys()
    size = np.max([np.abs(J).max(axis=(0, 1)) for J in full.values()], axis=0) + 1e-300  # of its strongest channel
    for quantity, J in full.items():
        off = np.abs(stages[quantity] - J).max(axis=(0, 1)) / size
        assert off.max() < 1e-12, f"{wanted[int(np.argmax(off))].label} in {quantity}: {off.max():.1e}"


def test_the_spanning_effects_are_those_that_say_so():
    """Stage by stage, without the way round, is wrong for exactly the effects that declare `spans_rows`."""
    made, s = recording_of("multi-position"), stimulus_of("multi-position")
    (wanted,) = parameters(CATALOGUE["gravity_error"])
    for name in sorted(CATALOGUE):
        if "multi-position" in CATALOGUE[name].kinds:
            there = [filled(name, "multi-position"), filled("base_tilt_drift", "multi-position", 0.0)]
            by = parameters(CATALOGUE["base_tilt_drift"])
            J = jacobian(made.platform, s, there, [wanted, *by])["specific_force"]
            rows = linearise(made.platform, s, there)
            local = np.stack(
                [rows.through(CATALOGUE["base_tilt_drift"].stage, added(p.index, s)) for p in by], axis=-1
            )[:, :3]
            same = np.abs(J[..., 1:] - local).max() < 1e-12 * np.abs(J[..., 1:]).max()
            assert same != CATALOGUE[name].spans_rows, name


def added(index, s):
    """What one unit of base_tilt_drift adds to the base."""
    out = np.zeros((len(s.time), 3))
    out[:, index] = s.time
    return out


def test_stages_come_in_the_order_of_the_model_in_whichever_order_they_are_asked_for():
    made, s = recording_of("multi-position"), stimulus_of("multi-position")
    for stages in (list(Stage), list(Stage)[::-1], frozenset(Stage)):
        shown = linearise(made.platform, s, (), stages=stages).seen
        assert list(shown) == sorted(shown, key=list(Stage).index)
        assert len(shown) > 5
