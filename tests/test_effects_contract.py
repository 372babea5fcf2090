"""What every effect of the catalogue must do, whoever wrote it."""

import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, absent, parameters, values, with_values
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.effects.effect import constants as constants_of
from gimbalcal.forward import jacobian, predict, turning
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import STEP, Array
from gimbalcal.platform import KNOWN, Platform
from gimbalcal.recording import Recording, Site
from gimbalcal.references import REFERENCES
from gimbalcal.simulate import simulate
from gimbalcal.units import from_si, parse

PAGE = Path(__file__).parents[2] / "shared" / "design" / "effects.md"
ALL = sorted(CATALOGUE)


def scenario(kind: str) -> dict[str, Any]:
    """18 positions with five rows per dwell, or 24 h with a row every 25 minutes; the temperature wanders."""
    common: dict[str, Any] = {"format": 1, "kind": kind, "site": {"latitude": {"value": 40.0, "unit": "deg"}}}
    table = {
        "shape": "table",
        "time_h": [0.0, 0.4, 1.1, 1.9, 3.3, 30.0],
        "value": [19.0, 21.5, 20.2, 23.0, 18.0, 22.0],
    }
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
    return replace(recording, channels={**recording.channels, **channels})


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
    return s.at(rate=turning(RECORDINGS[kind].platform, s, (), swing))


def rich(kind: str = "multi-position") -> Stimulus:
    """A stimulus with everything that any effect may ask for, and no force that is exactly zero."""
    s = stimulus_from_angles(RECORDINGS[kind])
    rng = np.random.default_rng(6)
    n, k = s.readout.shape
    return s.at(
        force=s.force + 0.01 * rng.standard_normal((n, 3)),
        move_force=s.move_force + 0.01 * rng.standard_normal((n, 3)),
        angle=s.angle + 0.01 * rng.standard_normal((n, k)),
        rate=0.1 * rng.standard_normal((n, 3)),
        true_angle=s.angle,
    )


def ready(name: str, kind: str = "multi-position") -> Effect:
    """The absent effect, and the channel named for those that take any covariate."""
    made = absent(CATALOGUE[name], RECORDINGS[kind].platform.axis_names)
    given = {"covariate": "supply_voltage"} if any(f.name == "covariate" for f in fields(made)) else {}
    return replace(made, **given)


def unknowns(name: str, constants: bool = True, kind: str = "multi-position") -> tuple[Parameter, ...]:
    found = parameters(CATALOGUE[name], RECORDINGS[kind].platform.axis_names, constants=constants)
    jumping = {f.name for f in constants_of(CATALOGUE[name]) if f.metadata["grid"].jumps}  # scanned, not differentiated
    return tuple(p for p in found if p.field not in jumping)


def filled(name: str, rng: np.random.Generator) -> Effect:
    """The effect with parameters of the size of their prior."""
    wanted = unknowns(name, constants=False)
    x = np.array([p.sigma for p in wanted]) * (0.5 + rng.random(len(wanted)))
    return with_values([ready(name)], wanted, x)[0]


def expected_shape(stage: Stage, s: Stimulus) -> tuple[int, ...]:
    n, k = s.readout.shape
    return {Stage.ENCODER: (n, k), Stage.AXIS_TILT: (n, k, 3)}.get(stage, (n, 3))


@pytest.mark.parametrize("name", ALL)
def test_card_is_complete(name: str) -> None:
    cls = CATALOGUE[name]
    assert cls.id == name
    card = " ".join((cls.__doc__ or "").split())
    for part in (".. math::", "Source:", "Magnitude:", "Seen by:"):
        assert part in card, f"the card of {name} lacks {part}"
    assert set(cls.sources) <= set(REFERENCES)
    assert cls.__subclasses__() == []  # an effect is final
    for p in unknowns(name):
        parse(p.unit)
        assert p.sigma > 0


def test_parameter_names_are_unique_so_that_a_calibration_can_be_read_back() -> None:
    owner: dict[str, str] = {}
    for name in ALL:
        for p in unknowns(name):
            assert owner.setdefault(p.name, name) == name, f"{p.name} is used by {owner[p.name]} and {name}"


OWN_IDS = {  # constituents of the baseline, and any logged channel: not rows of the catalogue's tables
    "bias", "scale_factor", "scale_nonlinearity", "misalignment", "base_tilt", "bias_covariate",
    "bias_covariate_lagged", "bias_covariate_squared", "gyro_bias", "gyro_scale_factor", "gyro_misalignment",
    "gyro_g_sensitivity_rate", "gyro_bias_drift", "gimbal_zero_drift", "gravity_leakage", "slow_bias_drift",
}  # fmt: skip


@pytest.mark.skipif(not PAGE.exists(), reason="the design's catalogue is not on this machine")
@pytest.mark.parametrize("name", ALL)
def test_id_is_one_of_the_catalogue(name: str) -> None:
    assert name in OWN_IDS | set(re.findall(r"`([a-z0-9_]+)`", PAGE.read_text()))


@pytest.mark.parametrize("kind", ["multi-position", "static-run"])
@pytest.mark.parametrize("name", ALL)
def test_absent_is_zero_and_the_shape_is_the_stage_s(name: str, kind: str) -> None:
    s = rich(kind)
    added = ready(name).contribution(s)
    assert np.broadcast_shapes(np.shape(added), expected_shape(CATALOGUE[name].stage, s)) == np.shape(added)
    assert not np.any(added)
    assert np.any(filled(name, np.random.default_rng(1)).contribution(s)) or CATALOGUE[name].kinds != (kind,)


@pytest.mark.parametrize("name", ALL)
def test_one_row_is_enough(name: str) -> None:
    s = rich()
    one: dict[str, Any] = {}
    for f in fields(s):
        value = getattr(s, f.name)
        one[f.name] = value[:1] if isinstance(value, np.ndarray) else value
    s = Stimulus(**one).at(covariates={k: v[:1] for k, v in s.covariates.items()})
    assert filled(name, np.random.default_rng(1)).contribution(s).shape == expected_shape(CATALOGUE[name].stage, s)


@pytest.mark.parametrize("name", ALL)
def test_complex_step_is_the_derivative_by_every_parameter(name: str) -> None:
    s, rng = rich(), np.random.default_rng(2)
    made, wanted = filled(name, rng), unknowns(name)
    x, scale = values([made], wanted), np.array([p.sigma for p in wanted])
    scale *= [1e-3 if "." in p.name else 1.0 for p in wanted]  # a period turns the phase of a day by many radians
    for unit in np.eye(len(wanted)):

        def at(step: complex, unit: Array = unit) -> Array:
            return with_values([made], wanted, x + step * scale * unit)[0].contribution(s)

        exact = at(1j * STEP).imag / STEP
        # central difference: cubic truncation 1e-10 of the third derivative, rounding 1e-16 / 1e-5
        close(exact, (at(1e-5) - at(-1e-5)).real / 2e-5, size=np.abs(at(0.0)).max())


def close(exact: Array, difference: Array, size: float) -> None:
    np.testing.assert_allclose(exact, difference, rtol=2e-6, atol=1e-6 * np.abs(difference).max() + 1e-9 * size)


@pytest.mark.parametrize("field", ["force", "angle", "move_force", "rate"])
@pytest.mark.parametrize("name", ALL)
def test_complex_step_is_the_derivative_by_the_stimulus(name: str, field: str) -> None:
    s, rng = rich(), np.random.default_rng(3)
    made = filled(name, rng)
    old = getattr(s, field)
    step = rng.standard_normal(old.shape)

    def at(h: complex) -> Array:
        return made.contribution(s.at(**{field: old + h * step}))

    close(np.imag(at(1j * STEP)) / STEP, np.real(at(1e-6) - at(-1e-6)) / 2e-6, size=1e3 * np.abs(at(0.0)).max())


@pytest.mark.parametrize("name", ALL)
def test_accepts_symbols_and_means_the_same_by_them(name: str) -> None:
    s, rng = short(rich()), np.random.default_rng(4)
    numeric, wanted = filled(name, rng), unknowns(name)
    x = values([numeric], wanted)
    names = sympy.symbols(f"p:{len(wanted)}", real=True)
    forces = sympy.symbols(f"f:{s.force.size}", real=True)
    symbolic = with_values([numeric], wanted, np.array(names, dtype=object))[0]
    made = symbolic.contribution(s.at(force=np.array(forces, dtype=object).reshape(s.force.shape)))
    given = dict(zip([*names, *forces], [*x, *s.force.ravel()], strict=True))
    found = np.array([float(sympy.sympify(e).subs(given)) for e in np.ravel(made)]).reshape(np.shape(made))
    expected = numeric.contribution(s)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def short(s: Stimulus) -> Stimulus:
    """The first row of the second dwell and the next."""
    rows = slice(5, 7)
    cut: dict[str, Any] = {f.name: getattr(s, f.name) for f in fields(s)}
    cut = {k: v[rows] if isinstance(v, np.ndarray) else v for k, v in cut.items()}
    return Stimulus(**cut).at(covariates={k: v[rows] for k, v in s.covariates.items()})


@pytest.mark.parametrize("name", ALL)
def test_what_is_called_linear_is_linear_and_the_rest_is_not(name: str) -> None:
    s = rich()
    wanted = unknowns(name, constants=False)
    one, two = (filled(name, np.random.default_rng(seed)) for seed in (7, 8))
    both = with_values([one], wanted, values([one], wanted) - 3 * values([two], wanted))[0]
    sum_of_parts = one.contribution(s) - 3 * two.contribution(s)
    size = np.abs(sum_of_parts).max()
    off = np.abs(both.contribution(s) - sum_of_parts).max()
    assert (off <= 1e-12 * size) == CATALOGUE[name].linear


# --- does a fit find it again, and say so where it cannot? -----------------------------------------------------------

SIGMA = {
    "specific_force": 2e-6 * G0, "angular_rate": 1e-7, "gimbal_angle": 2e-6, "attitude_error": 2e-6, "pointing": 5e-6,
}  # fmt: skip
OF_PRIOR = {"gravity_leakage": 0.01}  # of a unit that tilts a little; the table swings by radians
CASES = [(n, k) for n in ALL for k in RECORDINGS if k in CATALOGUE[n].kinds]


def test_every_effect_is_looked_for_in_every_kind_of_recording_that_it_names() -> None:
    assert {k for _, k in CASES} == {k for n in ALL for k in CATALOGUE[n].kinds}
    assert {n for n, _ in CASES} == set(ALL)


def rows(
    platform: Platform, s: Stimulus, effects: tuple[Effect, ...], wanted: tuple[Parameter, ...], kind: str
) -> tuple[Array, Array]:
    """Whitened prediction (m,) and Jacobian (m, p)."""
    h, J = predict(platform, s, effects, kind), jacobian(platform, s, effects, wanted, kind)
    return (
        np.concatenate([(h[c] / SIGMA[c]).ravel() for c in h]),
        np.concatenate([(J[c] / SIGMA[c]).reshape(-1, len(wanted)) for c in h]),
    )


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_is_recovered_where_it_is_seen_and_named_where_it_is_not(name: str, kind: str) -> None:
    recording, rng = RECORDINGS[kind], np.random.default_rng([9, len(name)])
    platform, s = recording.platform, experienced(kind)
    own = unknowns(name, constants=False, kind=kind)
    base = tuple(p for i in BASELINE[kind] if i != name for p in parameters(CATALOGUE[i], platform.axis_names))
    wanted = base + own
    # a fifth of the prior, so that iteration starts inside the linear range of every law
    truth = np.array([p.sigma for p in wanted]) * np.where([p in own for p in wanted], 1.0, 0.2)
    truth *= rng.standard_normal(len(wanted)) * np.where([p in own for p in wanted], 0.0, 1.0) + np.array(
        [float(p in own) for p in wanted]
    )
    truth *= [OF_PRIOR.get(p.effect, 1.0) for p in wanted]
    y = rows(platform, s, with_values((ready(name, kind),), wanted, truth, platform.axis_names), wanted, kind)[0]
    y = y + rng.standard_normal(y.size)
    x = np.zeros(len(wanted))
    for _ in range(3):
        h, J = rows(platform, s, with_values((ready(name, kind),), wanted, x, platform.axis_names), wanted, kind)
        solution = solve(information(J, y - h + J @ x, wanted))
        x = solution.x
    seen_part = J @ (x - truth)
    rank = len(wanted) - len(solution.unobservable)
    # chi^2 of `rank` degrees of freedom at 4 sigma (normal approximation, generous), plus what hides below one sigma
    assert seen_part @ seen_part < rank + 4 * np.sqrt(2 * rank) + 16 + 2 * len(solution.unobservable)
    named = {label for u in solution.unobservable for label in u.direction}
    for p, value, sigma, true in zip(wanted, x, solution.sigma, truth, strict=True):
        if p in own and p.label not in named:
            assert abs(value - true) < 4 * sigma, f"{p.label}: {from_si(value, p.unit)} against {from_si(true, p.unit)}"
    for p in own:
        if hidden(J, wanted, p) < 0.5:  # less than half a sigma of it is left once everything else has been fitted
            assert p.label in named, f"{p.label} is invisible and the fit does not say so"


def hidden(J: Array, wanted: tuple[Parameter, ...], p: Parameter) -> float:
    """What is left, in sigma, of one prior sigma of p when the other parameters imitate it by moves of some sigmas.

    Without the limit (ten prior sigmas count as one sigma of misfit) a column that is almost invisible would imitate
    anything, by thousands of its sigmas.
    """
    scaled = J * np.array([q.sigma for q in wanted])
    i = wanted.index(p)
    rest = np.vstack([np.delete(scaled, i, axis=1), 0.1 * np.eye(len(wanted) - 1)])
    target = np.concatenate([scaled[:, i], np.zeros(len(wanted) - 1)])
    return float(np.linalg.norm(target - rest @ np.linalg.lstsq(rest, target, rcond=None)[0]))
