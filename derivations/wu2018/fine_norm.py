r"""Eqs. (10) to (17): the norm observation of the fine calibration.

Half the difference of the squared norms of the true force and of the force computed with the coarse estimates. In this
section Delta is truth minus estimate. With u = SF_hat (f^a - b),

    f^p     = C_a^p (1 + Delta SF / SF_hat) (u - K u^2 / SF_hat)
    f_hat^p = C_hat_a^p (u + SF_hat b~),                      b~ = b - b_hat,

C_a^p the inverse of C_p^a at beta = beta_hat + Delta beta. Expanded through second order in everything small (the
Deltas, K, and the coarse estimates beta_hat), the printed right-hand sides must be the first-order part.

The deviation of C_a^p is minus that of C_p^a: Eq. (14) prints the former under the name of the latter, and Eq. (10),
which needs the former, uses that name. The two slips cancel, so (16) and (17) come out right.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import ARCSEC, Case, Printed, magnitude, truncate
from derivations.wu2018 import table1
from derivations.wu2018.frames import platform_to_accelerometers
from derivations.wu2018.symbols import BETA, G_NORMAL, TABLE_2, TABLE_3

SF_hat = sp.symbols("SFhat_x SFhat_y SFhat_z", positive=True)
dSF = sp.symbols("DeltaSF_x DeltaSF_y DeltaSF_z", real=True)
db = sp.symbols("btilde_x btilde_y btilde_z", real=True)
K = sp.symbols("K_x K_y K_z", real=True)
dBETA = sp.symbols("Dbeta_xy Dbeta_xz Dbeta_yz Dbeta_yx Dbeta_zx Dbeta_zy", real=True)
BETA_HAT = sp.symbols("betahat_xy betahat_xz betahat_yz betahat_yx betahat_zx betahat_zy", real=True)
u = sp.symbols("u_x u_y u_z", real=True)
f, d = sp.symbols("f d", positive=True)
DEVIATIONS = (*dSF, *db, *K, *dBETA)
SMALL = (*DEVIATIONS, *BETA_HAT)

Dxy, Dxz, Dyz, Dyx, Dzx, Dzy = dBETA
ux, uy, uz = u
U = sp.Matrix(u)
M14 = sp.Matrix([[0, -Dxz, Dxy], [Dyz, 0, -Dyx], [-Dzy, Dzx, 0]])

ROW = sp.Matrix([[ux**2, uy**2, uz**2, -ux, -uy, -uz, -(ux**3), -(uy**3), -(uz**3), ux * uy, ux * uz, uz * uy]])
DX = sp.Matrix(
    [a / S for a, S in zip(dSF, SF_hat, strict=True)]
    + [S * a for a, S in zip(db, SF_hat, strict=True)]
    + [a / S for a, S in zip(K, SF_hat, strict=True)]
    + [Dyz - Dxz, Dxy - Dzy, Dzx - Dyx]
)


def printed_10(M: Any) -> Any:
    """Return the right-hand side of Eq. (10) with the matrix that stands for Delta C."""
    scale = sum(x**2 * a / S for x, a, S in zip(u, dSF, SF_hat, strict=True))
    skew = (U.T * (M.T + M) * U)[0] / 2
    bias = sum(x * S * a for x, S, a in zip(u, SF_hat, db, strict=True))
    cubic = sum(x * S * k * (x / S) ** 2 for x, S, k in zip(u, SF_hat, K, strict=True))
    return sp.expand(scale + skew - bias - cubic)


PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (10)",
            "1/2 (f^pT f^p - f_hat^pT f_hat^p) = (SF_hat(f^a-db))^2 SF_hat^-1 Delta SF + 1/2 (SF_hat(f^a-db))^T "
            "((Delta C_p^a)^T + Delta C_p^a)(SF_hat(f^a-db)) - (SF_hat(f^a-db))^T SF_hat db~ "
            "- (SF_hat(f^a-db))^T SF_hat K_nl (f^a-db)(f^a-db)",
            printed_10(M14),
        ),
        Printed("Eq. (11)", "1/2 ((f^p)^2 - (f_hat^p)^2) ~ f^p (f^p - f_hat^p)", f * d),
        Printed("Eq. (12)", "Delta SF = SF - SF_hat = diag(Delta SF_x, Delta SF_y, Delta SF_z)", sp.diag(*dSF)),
        Printed("Eq. (13)", "db~ = db - db_hat = diag(db~_x, db~_y, db~_z)", sp.diag(*db)),
        Printed(
            "Eq. (14)",
            "Delta C_p^a = [0, -Dbeta_xz, Dbeta_xy; Dbeta_yz, 0, -Dbeta_yx; -Dbeta_zy, Dbeta_zx, 0]",
            M14,
        ),
        Printed("Eq. (15)", "f_hat^a = SF_hat (f^a - delta b)", U),
        Printed(
            "Eq. (16)",
            "[fx^2 fy^2 fz^2 -fx -fy -fz -fx^3 -fy^3 -fz^3 fx fy, fx fz, fz fy] dx = f^p (f^p - f_hat^p_j)",
            sp.expand((ROW * DX)[0]),
        ),
        Printed(
            "Eq. (17)",
            "dx = [DSF_x/SF_x .. | SF_x Delta b~_x .. | K_nlx/SF_x .. | Dbeta_yz - Dbeta_xz, Dbeta_xy - Dbeta_zy, "
            "Dbeta_zx - Dbeta_yx]^T",
            DX,
            garbled="hats stand over Delta SF and Delta b~ for delta b~ of Eq. (13)",
        ),
    )
}


@cache
def _matrix(first: tuple[Any, ...], second: tuple[Any, ...]) -> Any:
    """Return C_p^a - 1 at beta = first + second."""
    values = {x: a + b for x, a, b in zip(BETA, first, second, strict=True)}
    return platform_to_accelerometers().subs(values) - sp.eye(3)


def _inverse_norm(vector: Any, B: Any) -> Any:
    """Return |(1 + B)^-1 vector|^2 through second order in B."""
    inverse = sp.eye(3) - B + B * B
    w = inverse * vector
    return (w.T * w)[0]


@cache
def observation() -> Any:
    """Return the left-hand side of Eq. (10) through second order in everything small."""
    scaled = [(1 + a / S) * (x - k * x**2 / S) for x, a, k, S in zip(u, dSF, K, SF_hat, strict=True)]
    shifted = [x + S * a for x, S, a in zip(u, SF_hat, db, strict=True)]
    zero = (sp.Integer(0),) * 6
    true = _inverse_norm(sp.Matrix(scaled), _matrix(BETA_HAT, dBETA))
    estimated = _inverse_norm(sp.Matrix(shifted), _matrix(BETA_HAT, zero))
    return truncate((true - estimated) / 2, SMALL, 2)


@cache
def unknowns() -> Any:
    """Return the twelve combinations: coefficients of the monomials of u in the first-order observation."""
    poly = sp.Poly(truncate(observation(), SMALL, 1), *u)
    signed = [poly.coeff_monomial(abs_) * sign for abs_, sign in _monomials()]
    return sp.Matrix([sp.expand(x) for x in signed])


def _monomials() -> list[tuple[Any, int]]:
    return [(-m, -1) if m.could_extract_minus_sign() else (m, 1) for m in ROW]


def directions() -> Any:
    """Return the unit specific force (18, 3) of the eighteen positions, from the angles of Table 1."""
    zeros = dict.fromkeys(table1.ZEROS, 0)
    return np.array([[-float(x) for x in table1.gravity(*angles).subs(zeros)] for angles in table1.resolved_angles()])


def coarse_numbers() -> dict[Any, float]:
    """Return deviations of the size of Tables 2 and 3, K_nl = 10 ug/g^2, coarse misalignments of 60 arcsec; unit g."""
    scale, bias = list(TABLE_2.values())[:3], list(TABLE_2.values())[3:]
    return {
        **dict.fromkeys(SF_hat, 1.0),
        **dict(zip(dSF, scale, strict=True)),
        **dict(zip(db, (x / G_NORMAL for x in bias), strict=True)),
        **dict.fromkeys(K, 1e-5),
        **{new: TABLE_3[old] for new, old in zip(dBETA, BETA, strict=True)},
        **dict.fromkeys(BETA_HAT, 60 * ARCSEC),
    }


def ranks() -> tuple[int, int, float]:
    """Return the rank of the 18 positions in the twelve unknowns and in the 15 deviations, and the condition of the
    former.
    """
    numeric_row = sp.lambdify(u, ROW)
    first = truncate(observation(), SMALL, 1).subs(dict.fromkeys(SF_hat, 1))
    gradient = sp.lambdify(u, sp.Matrix([[first.diff(x) for x in DEVIATIONS]]))
    A = np.vstack([numeric_row(*x) for x in directions()])
    B = np.vstack([gradient(*x) for x in directions()])
    return int(np.linalg.matrix_rank(A)), int(np.linalg.matrix_rank(B)), float(np.linalg.cond(A))


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    numbers = coarse_numbers()
    positions = tuple(dict(zip(u, map(float, x), strict=True)) for x in directions())
    first = truncate(observation(), SMALL, 1)
    largest = magnitude(first, numbers, positions)
    shift = sp.Matrix([S * a for S, a in zip(SF_hat, db, strict=True)])
    effect = truncate(first.subs(dict(zip(u, U + shift, strict=True)), simultaneous=True), SMALL, 2) - first
    deviation = _matrix(BETA_HAT, dBETA) - _matrix(BETA_HAT, (0,) * 6)
    full, separate, condition = ranks()
    return {
        "Eq. (10)": Case(
            observation(),
            "Right to first order if Delta C_p^a stands for the matrix printed in (14), which is Delta C_a^p; with the "
            "deviation of (5) its sign would be wrong. Dropped: squares of the deviations and products with the coarse "
            "misalignments, up to {size} (deviations of Tables 2 and 3, coarse misalignments 60 arcsec).",
            small=SMALL,
            at=numbers,
            sweep=positions,
            unit="ug",
        ),
        "Eq. (11)": Case(
            sp.expand((f**2 - (f - d) ** 2) / 2),
            "The square (f - f_hat)^2 / 2 is dropped: up to {size} where the norms differ by {largest}.",
            small=(d,),
            at={f: 1.0, d: largest},
            unit="ug",
            facts={"largest": f"{largest:.1e} g"},
        ),
        "Eq. (12)": Case(
            None,
            "It is truth minus estimate. From (20) on the paper counts the other way round.",
        ),
        "Eq. (13)": Case(
            sp.Matrix(db),
            "A diagonal matrix is printed for a vector: in (10) u^T SF_hat db~ must be a number, so db~ is a column.",
            repairs=(("a diagonal matrix for a column vector", lambda f: f.diagonal().T if f.is_diagonal() else f),),
        ),
        "Eq. (14)": Case(
            deviation,
            "By (5) and truth minus estimate every sign is the other way round: what is printed is Delta C_a^p, which "
            "(10) needs. With the printed name the entries are off by twice each Delta beta, up to {size} for Table 3; "
            "(16) and (17) are not affected.",
            at=numbers,
            unit="arcsec",
        ),
        "Eq. (15)": Case(
            U + shift,
            "The true bias is not known; it must be the estimate b_hat. The difference is up to {size} in f_hat^a but "
            "second order in (16): up to {effect}.",
            small=db,
            at=numbers,
            unit="ug",
            facts={"effect": f"{magnitude(effect, numbers, positions) * 1e6:.1g} ug"},
        ),
        "Eq. (16)": Case(
            observation(),
            "All twelve columns and signs are right to first order with Delta = truth minus estimate; up to {size} of "
            "second order is left, gone after one more iteration. Over the 18 positions the rank is {full} of 12, "
            "condition number {condition:.0f} in units of g.",
            facts={"full": full, "condition": condition},
            small=SMALL,
            at=numbers,
            sweep=positions,
            unit="ug",
        ),
        "Eq. (17)": Case(
            unknowns(),
            "The combinations are right: 15 deviations enter with rank {separate}, only beta_yz - beta_xz, "
            "beta_xy - beta_zy, beta_zx - beta_yx are seen, not their sums.",
            facts={"separate": separate},
        ),
    }
