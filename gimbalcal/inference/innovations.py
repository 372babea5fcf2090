r"""Information of measurements of a few dynamic states about constants, as whitened rows; no physics.

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \theta + w_k, \qquad z_k = x_k[i] + v_k, \qquad \theta = \text{const}

With the constants known, the innovations of a filter of x alone are white. Their response to the constants is linear,

.. math:: D_{k+1} = (1 - K_k H)(\Phi_k D_k + \Psi_k), \qquad \text{row}_k = s_k^{-1/2} \, H (\Phi_k D_k + \Psi_k) ,

and neither the gain K nor the variance s of an innovation depends on them: each component of z is one whitened row
about theta (Friedland 1969). That is all the information of a filter with the constants among its states, without a
prior, at a cost of m^2 p a step instead of (m + p)^3, in the form needed for null directions and bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.inference import square_root_filter
from gimbalcal.inference.adjoint import innovation_response
from gimbalcal.number import Array


class Innovations(NamedTuple):
    """Rows (K, c, p) about the constants; D (K + 1, m, p): response of x to them; P (K + 1, m, m) of x if known."""

    rows: Array
    D: Array
    P: Array


def innovations(Phi: Array, Psi: Array, Q: Array, index: Array, R: Array, sigma: Array) -> Innovations:
    """Return the rows of K steps of m states and p constants: transition, then states `index` (c,), variances R (K, c).

    Phi (K, m, m), Psi (K, m, p), Q (K, m, m); sigma (m,): of the states at the start, where D is zero.
    """
    root, m = square_root_filter.roots(Q), len(sigma)
    d, z, none = np.zeros(Phi.shape[:2]), np.zeros(R.shape), np.zeros(0)
    f = square_root_filter.filter(Phi, Psi[..., :0], root, d, z, index, R, np.zeros(m), none, np.diag(sigma))
    e, D = innovation_response(Phi, Psi, index, f.variance, f.gain, m)
    return Innovations(-e / np.sqrt(f.variance)[..., None], D, f.cross)
