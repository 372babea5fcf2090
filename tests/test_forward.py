"""The one forward model, against the printed equations and against itself on other kinds of number."""

import numpy as np
import pytest
import sympy

from gimbalcal.effects import CATALOGUE, parameters, with_values, zero_effect
from gimbalcal.forward import jacobian, navigator_attitude_error, predict
from gimbalcal.platform import BENCH, SPACE_STABLE, SPACE_STABLE_INERTIAL
from tests.golden import refused
from tests.stimuli import LATITUDE, G, eighteen, static

EIGHTEEN_COEFFICIENTS = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")
STATIC = ("scale_factor", "bias", "misalignment", "gimbal_zero", "base_tilt", "polar_axis_misalignment")


def unknowns(ids):
    return tuple(p for i in ids for p in parameters(CATALOGUE[i], SPACE_STABLE.axis_names) if p.axis != "outer")


def drawn(wanted, seed=1):
    x = np.random.default_rng(seed).normal(size=len(wanted)) * [p.sigma for p in wanted]
    return with_values((), wanted, x, SPACE_STABLE.axis_names)


def test_without_effects_the_force_is_minus_gravity():
    s = eighteen()
    np.testing.assert_allclose(predict(SPACE_STABLE, s, ())["specific_force"], s.force, atol=1e-15)
    assert predict(SPACE_STABLE, s, ())["specific_force"][0, 2] == pytest.approx(-G)  # z points down, reads -g


def test_eq_6_holds_exactly():
    """f^a = SF^-1 C_p^a f^p + b + K_nl (f^a - b)^2, coefficient by coefficient, at sizes where second order shows."""
    effects = drawn(unknowns(EIGHTEEN_COEFFICIENTS))
    by_id = {e.id: e for e in effects}
    s = eighteen()
    f_a = predict(SPACE_STABLE, s, effects)["specific_force"]
    zero = by_id["gimbal_zero"].theta_0
    f_p = -G * SPACE_STABLE.attitude(s.readout + zero)[..., 2]
    xy, xz, yz, yx, zx, zy = by_id["misalignment"].beta
    C_pa = np.array([[1, xz, -xy], [-yz, 1, yx], [zy, -zx, 1]])  # Eq. (5)
    SF = 1 + by_id["scale_factor"].s
    b, K = by_id["bias"].b, by_id["scale_nonlinearity"].K_nl
    np.testing.assert_allclose(f_a, (f_p @ C_pa.T) / SF + b + K * (f_a - b) ** 2, rtol=0, atol=4e-15)


def test_eq_6_on_symbols_is_the_printed_one():
    f, b, K, s, xz, xy = sympy.symbols("f_y b_x K_x s_x beta_xz beta_xy", real=True)
    zero = sympy.Integer(0)
    effects = (
        CATALOGUE["misalignment"](beta=np.array([xy, xz, zero, zero, zero, zero], dtype=object)),
        CATALOGUE["scale_factor"](s=np.array([s, zero, zero], dtype=object)),
        CATALOGUE["scale_nonlinearity"](K_nl=np.array([K, zero, zero], dtype=object)),
        CATALOGUE["bias"](b=np.array([b, zero, zero], dtype=object)),
    )
    stimulus = eighteen().at(force=np.array([[zero, f, zero]], dtype=object))
    y = predict(BENCH, stimulus, effects)["specific_force"][0, 0]
    assert sympy.simplify(y - (xz * f / (1 + s) + b + K * (y - b) ** 2)) == 0


@pytest.mark.parametrize(
    ("kind", "ids", "platform"),
    [("multi-position", EIGHTEEN_COEFFICIENTS, SPACE_STABLE), ("static-run", STATIC, SPACE_STABLE_INERTIAL)],
)
def test_jacobian_equals_central_difference(kind, ids, platform):
    s = eighteen() if kind == "multi-position" else static(24, 3600)
    wanted = unknowns(ids)
    effects = drawn(wanted)
    J = jacobian(platform, s, effects, wanted, kind)
    x = np.array([p.sigma for p in wanted]) * np.random.default_rng(1).normal(size=len(wanted))
    for i, p in enumerate(wanted):
        h = np.zeros(len(wanted))
        h[i] = 1e-2 * p.sigma
        up, down = (predict(platform, s, with_values((), wanted, x + sign * h, s.axis_names), kind) for sign in (1, -1))
        for channel, exact in J.items():
            numeric = (up[channel] - down[channel]) / (2 * h[i])
            # rounding of outputs of order 10 over a step of order 1e-6, and the third derivative
            np.testing.assert_allclose(exact[..., i], numeric, atol=1e-15 * 10 / h[i] + 1e-6, err_msg=p.label)


def test_a_perfect_static_run_reads_the_ideal_angles_and_no_attitude_error():
    s = static()
    out = predict(SPACE_STABLE_INERTIAL, s, (), "static-run")
    np.testing.assert_allclose(out["specific_force"], s.force, atol=1e-14)  # Eq. (19)
    expected = np.stack([np.angle(np.exp(1j * s.readout[:, 0]))] + [s.readout[:, i] for i in (1, 2, 3)], -1)
    np.testing.assert_allclose(out["gimbal_angle"], expected, atol=1e-14)
    np.testing.assert_allclose(out["attitude_error"], 0, atol=1e-14)


def test_the_accelerometers_of_a_fixed_platform_are_blind_to_base_tilt_and_encoders():
    s = static()
    tilted = (zero_effect(CATALOGUE["base_tilt"]), zero_effect(CATALOGUE["gimbal_zero"], s.axis_names))
    wanted = unknowns(("base_tilt", "gimbal_zero"))
    J = jacobian(SPACE_STABLE_INERTIAL, s, tilted, wanted, "static-run")
    np.testing.assert_array_equal(J["specific_force"], 0)
    assert np.abs(J["gimbal_angle"]).max() > 0.5


def test_gimbal_readout_and_zero_add_to_the_angle():
    s = static(4)
    zero = CATALOGUE["gimbal_zero"](theta_0=np.array([1e-4, 0, -2e-4, 3e-4]))
    perfect = predict(SPACE_STABLE_INERTIAL, s, (), "static-run")["gimbal_angle"]
    out = predict(SPACE_STABLE_INERTIAL, s, (zero,), "static-run")["gimbal_angle"]
    np.testing.assert_allclose(perfect - out, np.broadcast_to([1e-4, 0, -2e-4, 3e-4], out.shape), atol=1e-15)


def test_the_inner_gimbal_is_servoed_to_its_readout_so_its_zero_tilts_what_the_navigator_sees():
    s = static()
    zero = CATALOGUE["gimbal_zero"](theta_0=np.array([0, 1e-6, 0, 0]))
    out = predict(SPACE_STABLE_INERTIAL, s, (zero,), "static-run")
    np.testing.assert_allclose(out["gimbal_angle"][:, 1], 0, atol=1e-16)
    # the inner axis lies along (-sin L, 0, -cos L) of the base, and so does the turn that the readouts do not show
    expected = 1e-6 * np.array([np.sin(LATITUDE), 0, np.cos(LATITUDE)])
    np.testing.assert_allclose(out["attitude_error"], np.broadcast_to(expected, (len(s.time), 3)), atol=3e-12)


def test_roll_of_a_force_error_along_east_has_the_sign_of_eq_28():
    """A measured force error Delta f^E gives roll error + Delta f_E / g (Eq. (28), first vector, first row)."""
    s = static(24, 3600)
    north_east_down = np.array([0.0, 1e-5 * G, 0.0])
    from gimbalcal.kinematics import navigation_to_platform

    C_np = navigation_to_platform(s.readout[:, 0], LATITUDE)
    error = navigator_attitude_error(SPACE_STABLE_INERTIAL, s.force + C_np @ north_east_down, s.readout)
    np.testing.assert_allclose(error[:, 0], 1e-5, rtol=1e-4)
    np.testing.assert_allclose(error[:, 1], 0, atol=1e-9)
    np.testing.assert_allclose(error[:, 2], -1e-5 * np.tan(LATITUDE), rtol=1e-4)


def test_a_static_run_without_latitude_is_refused():
    with refused():
        predict(SPACE_STABLE_INERTIAL, static().at(latitude=None), (), "static-run")
