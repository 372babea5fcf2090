"""What every effect of the catalogue must do, whoever wrote it."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import sympy

from gimbalcal.effects import CATALOGUE, Stage, Stimulus, values, with_values
from gimbalcal.effects.effect import constants
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import STEP
from gimbalcal.references import REFERENCES
from gimbalcal.units import parse
from tests.effects.recordings import RECORDINGS, ready, unknowns

ALL = sorted(CATALOGUE)


def rich(kind="multi-position"):
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


def filled(name, rng):
    """The effect with parameters of the size of their prior."""
    wanted = unknowns(name, constants=False)
    x = np.array([p.sigma for p in wanted]) * (0.5 + rng.random(len(wanted)))
    return with_values([ready(name)], wanted, x)[0]


def expected_shape(stage, s):
    n, k = s.readout.shape
    return {Stage.ENCODER: (n, k), Stage.AXIS_TILT: (n, k, 3)}.get(stage, (n, 3))


@pytest.mark.parametrize("name", ALL)
def test_card_is_complete(name):
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


def test_parameter_names_are_unique_so_that_a_calibration_can_be_read_back():
    owner: dict[str, str] = {}
    for name in ALL:
        for p in unknowns(name):
            assert owner.setdefault(p.name, name) == name, f"{p.name} is used by {owner[p.name]} and {name}"


@pytest.mark.parametrize("kind", ["multi-position", "static-run"])
@pytest.mark.parametrize("name", ALL)
def test_absent_is_zero_and_the_shape_is_the_stage_s(name, kind):
    s = rich(kind)
    added = ready(name).contribution(s)
    assert np.broadcast_shapes(np.shape(added), expected_shape(CATALOGUE[name].stage, s)) == np.shape(added)
    assert not np.any(added)
    assert np.any(filled(name, np.random.default_rng(1)).contribution(s)) or CATALOGUE[name].kinds != (kind,)


@pytest.mark.parametrize("name", ALL)
def test_one_row_is_enough(name):
    s = rich()
    one: dict[str, Any] = {}
    for f in fields(s):
        value = getattr(s, f.name)
        one[f.name] = value[:1] if isinstance(value, np.ndarray) else value
    s = Stimulus(**one).at(covariates={k: v[:1] for k, v in s.covariates.items()})
    assert filled(name, np.random.default_rng(1)).contribution(s).shape == expected_shape(CATALOGUE[name].stage, s)


@pytest.mark.parametrize("name", ALL)
def test_complex_step_is_the_derivative_by_every_parameter(name):
    s, rng = rich(), np.random.default_rng(2)
    made, wanted = filled(name, rng), unknowns(name)
    x, scale = values([made], wanted), np.array([p.sigma for p in wanted])
    scale *= [1e-3 if "." in p.name else 1.0 for p in wanted]  # a period turns the phase of a day by many radians
    for unit in np.eye(len(wanted)):

        def at(step, unit=unit):
            return with_values([made], wanted, x + step * scale * unit)[0].contribution(s)

        exact = at(1j * STEP).imag / STEP
        # central difference: cubic truncation 1e-10 of the third derivative, rounding 1e-16 / 1e-5
        close(exact, (at(1e-5) - at(-1e-5)).real / 2e-5, size=np.abs(at(0.0)).max())


SMOOTH = [(n, f.name) for n in ALL for f in constants(CATALOGUE[n]) if f.metadata["grid"].smooth]


@pytest.mark.parametrize(("name", "field"), SMOOTH)
def test_complex_step_is_the_derivative_by_a_constant_anywhere_in_its_range(name, field):
    made, largest = filled(name, np.random.default_rng(5)), 0.0
    m = next(f.metadata for f in constants(type(made)) if f.name == field)
    inside = m["low"] + np.array([0.01, 0.1, 0.5, 0.9]) * (m["high"] - m["low"])
    for kind in CATALOGUE[name].kinds:
        s = rich(kind)
        for value in (getattr(made, field), *inside):

            def at(step, value=value, s=s):
                return replace(made, **{field: value + step * (value or m["high"])}).contribution(s)

            exact = np.imag(at(1j * STEP)) / STEP
            h = 1e-8  # relative: the phase of servo_limit_cycle.period runs through thousands of radians
            difference = np.real(at(h) - at(-h)) / (2 * h)
            # rounding: 1e-16 / 1e-8, of what is added and of its phase
            np.testing.assert_allclose(
                exact, difference, rtol=0, atol=1e-4 * np.abs(difference).max() + 1e-7 * np.abs(at(0.0)).max()
            )
            largest = max(largest, np.abs(difference).max() / max(np.abs(at(0.0)).max(), 1e-300))
    assert largest > 1e-3  # the derivative is there to be lost


def close(exact, difference, size):
    np.testing.assert_allclose(exact, difference, rtol=2e-6, atol=1e-6 * np.abs(difference).max() + 1e-9 * size)


@pytest.mark.parametrize("field", ["force", "angle", "move_force", "rate"])
@pytest.mark.parametrize("name", ALL)
def test_complex_step_is_the_derivative_by_the_stimulus(name, field):
    s, rng = rich(), np.random.default_rng(3)
    made = filled(name, rng)
    old = getattr(s, field)
    step = rng.standard_normal(old.shape)

    def at(h):
        return made.contribution(s.at(**{field: old + h * step}))

    close(np.imag(at(1j * STEP)) / STEP, np.real(at(1e-6) - at(-1e-6)) / 2e-6, size=1e3 * np.abs(at(0.0)).max())


@pytest.mark.parametrize("name", ALL)
def test_accepts_symbols_and_means_the_same_by_them(name):
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


def short(s):
    """The first row of the second dwell and the next."""
    rows = slice(5, 7)
    cut: dict[str, Any] = {f.name: getattr(s, f.name) for f in fields(s)}
    cut = {k: v[rows] if isinstance(v, np.ndarray) else v for k, v in cut.items()}
    return Stimulus(**cut).at(covariates={k: v[rows] for k, v in s.covariates.items()})


@pytest.mark.parametrize("name", ALL)
def test_what_is_called_linear_is_linear_and_the_rest_is_not(name):
    s = rich()
    wanted = unknowns(name, constants=False)
    one, two = (filled(name, np.random.default_rng(seed)) for seed in (7, 8))
    both = with_values([one], wanted, values([one], wanted) - 3 * values([two], wanted))[0]
    sum_of_parts = one.contribution(s) - 3 * two.contribution(s)
    size = np.abs(sum_of_parts).max()
    off = np.abs(both.contribution(s) - sum_of_parts).max()
    assert (off <= 1e-12 * size) == CATALOGUE[name].linear
