"""Eqs. (1) to (5): specific force at rest, the two direction cosine matrices, the installation errors.

n: north, east, down; gravity is (0, 0, g) and a body at rest is held up by f = a - g = (0, 0, -g).

C_n^b: turn the n frame by yaw about down, by pitch about the new y, by roll about the new x.

C_b^p: from the base outwards in, q turns the outer gimbal about the base's z, h the middle gimbal about y, the inner
gimbal stays at zero, S_t turns the platform about its own z. The zero of h is where z_p points forward along x_b
(the frame is then turned by 90 deg about y), and h, q, S_t count so that z_p stands h above the horizon: then h reads
the latitude when z_p points to the pole, and S_t grows with the Earth's rotation.

C_p^a: row i is the input axis i in platform components: the platform axis i turned by two small angles about the two
others, beta_xy about y and beta_xz about z for x, and so on. First order, as the paper states.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import Case, Printed, truncate
from derivations.wu2018.symbols import BETA, NUMBERS, Rx, Ry, Rz, S_t, g, h, phi, psi, q, theta

beta_xy, beta_xz, beta_yz, beta_yx, beta_zx, beta_zy = BETA
s, c = sp.sin, sp.cos
f_n = sp.Matrix([0, 0, -g])
C_bp = sp.Matrix(3, 3, sp.symbols("c1:10"))  # nine direction cosines that could be any
C_nb = sp.Matrix(3, 3, sp.symbols("d1:10"))

PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (1)", "f^n = [0 0 -g]^T", f_n),
        Printed(
            "Eq. (2)",
            "f^p = C^p_h C^b_n f^n",
            C_bp * C_nb * f_n,
            garbled="the subscript of C_b^p reads h; no other matrix takes b to p",
        ),
        Printed(
            "Eq. (3)",
            "C_n^b = [cos psi cos theta, sin psi cos theta, -sin theta; -sin psi cos phi + cos psi sin theta sin phi, "
            "cos psi cos phi + sin psi sin theta sin phi, cos theta sin phi; sin psi sin phi + cos psi sin theta "
            "cos phi, -cos psi sin phi + sin psi sin theta cos phi, cos theta cos phi]",
            sp.Matrix(
                [
                    [c(psi) * c(theta), s(psi) * c(theta), -s(theta)],
                    [
                        -s(psi) * c(phi) + c(psi) * s(theta) * s(phi),
                        c(psi) * c(phi) + s(psi) * s(theta) * s(phi),
                        c(theta) * s(phi),
                    ],
                    [
                        s(psi) * s(phi) + c(psi) * s(theta) * c(phi),
                        -c(psi) * s(phi) + s(psi) * s(theta) * c(phi),
                        c(theta) * c(phi),
                    ],
                ]
            ),
        ),
        Printed(
            "Eq. (4)",
            "C_b^p = [-cos S_t sin h cos q - sin S_t sin q, cos S_t sin h sin q - sin S_t cos q, -cos S_t cos h; "
            "-sin S_t sin h cos q + cos S_t sin q, sin S_t sin h sin q + cos S_t cos q, -sin S_t cos h; "
            "cos h cos q, -cos h sin q, -sin h]",
            sp.Matrix(
                [
                    [
                        -c(S_t) * s(h) * c(q) - s(S_t) * s(q),
                        c(S_t) * s(h) * s(q) - s(S_t) * c(q),
                        -c(S_t) * c(h),
                    ],
                    [
                        -s(S_t) * s(h) * c(q) + c(S_t) * s(q),
                        s(S_t) * s(h) * s(q) + c(S_t) * c(q),
                        -s(S_t) * c(h),
                    ],
                    [c(h) * c(q), -c(h) * s(q), -s(h)],
                ]
            ),
        ),
        Printed(
            "Eq. (5)",
            "C_p^a = [1, beta_xz, -beta_xy; -beta_yz, 1, beta_yx; beta_zy, -beta_zx, 1]",
            sp.Matrix([[1, beta_xz, -beta_xy], [-beta_yz, 1, beta_yx], [beta_zy, -beta_zx, 1]]),
        ),
    )
}


def base_to_platform() -> Any:
    """Return C_b^p from the gimbal chain, exact."""
    return Rz(-S_t) * Rx(0) * Ry(h + sp.pi / 2) * Rz(-q)


def exact_input_axes() -> Any:
    """Return rows: the input axes in platform components, each a platform axis turned by its two angles in turn."""
    x = Rz(-beta_xz) * Ry(-beta_xy) * sp.Matrix([1, 0, 0])
    y = Rx(-beta_yx) * Rz(-beta_yz) * sp.Matrix([0, 1, 0])
    z = Ry(-beta_zy) * Rx(-beta_zx) * sp.Matrix([0, 0, 1])
    return sp.Matrix.hstack(x, y, z).T


def platform_to_accelerometers() -> Any:
    """Return C_p^a to first order in the angles."""
    return truncate(exact_input_axes(), BETA, 1)


def second_order() -> float:
    """Return the largest entry that Eq. (5) drops, for the angles of Table 3."""
    dropped = exact_input_axes() - platform_to_accelerometers()
    return max(abs(float(x.subs(NUMBERS).evalf())) for x in dropped)


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    at_rest = sp.Matrix([0, 0, 0]) - sp.Matrix([0, 0, g])  # a - g
    f_b = C_nb * f_n
    return {
        "Eq. (1)": Case(at_rest, "Specific force is a - g and a = 0."),
        "Eq. (2)": Case(C_bp * f_b, "Indices chain: n to b, then b to p."),
        "Eq. (3)": Case(Rx(phi) * Ry(theta) * Rz(psi), "Rx(roll) Ry(pitch) Rz(yaw), frame rotations."),
        "Eq. (4)": Case(
            base_to_platform().applyfunc(sp.trigsimp),
            "Rz(-S_t) Rx(0) Ry(h + 90 deg) Rz(-q): the chain of Table 1 with theta_1 = -S_t, theta_3 = h + 90 deg.",
        ),
        "Eq. (5)": Case(
            platform_to_accelerometers(),
            "First order in the angles; the second order is {second} with Table 3.",
            small=BETA,
            facts={"second": f"{second_order():.1e}"},
        ),
    }
