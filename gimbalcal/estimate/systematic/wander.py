r"""Biases that wander: the noise states of the filter, from the processes that `[noise]` of a recording states.

A chain of a process (`effects.process`) adds its value x to the readings of one channel. Over a stretch it is taken by
the mean of where it begins and where it tends, :math:`\tfrac{1}{2} (1 + \Phi) x`, and it moves on at its end:

.. math:: x_{k+1} = \Phi(h_k) x_k + w_k, \qquad w_k \sim N(0, Q(h_k))

What it does to the navigator within a stretch is what a constant addition to the reading does there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.estimate.systematic.course import KEYS, Course
from gimbalcal.number import Array
from gimbalcal.recording.noise import coloured

SHORTEST = 2.0  # s; flicker of shorter periods is below the white noise of any instrument


@dataclass(frozen=True, eq=False)
class Chains:
    """c chains beside the navigation states, in SI.

    channel (c,): what each adds to; Phi, Q (K, c) over each stretch; P_0 (c,) of the first; scale (c,): their size by
    the end of the recording.
    """

    channel: Array
    Phi: Array
    Q: Array
    P_0: Array
    scale: Array

    def __len__(self) -> int:
        return len(self.channel)


def chains(course: Course) -> Chains:
    """The chains of all six channels; none where the header states white noise alone."""
    h = np.diff(course.time)
    still = np.zeros(len(h), dtype=bool)
    told = coloured(course.rows, SHORTEST, float(h.sum()))
    parts = [(i, process) for i, (quantity, _) in enumerate(KEYS) for process in told.get(quantity, ())]
    channel = np.concatenate([np.zeros(0, dtype=int), *(np.full(len(p.output()), i) for i, p in parts)])
    H = np.concatenate([np.zeros(0), *(p.output() for _, p in parts)])
    Phi = np.concatenate([np.zeros((len(h), 0)), *(p.transition(h, still) for _, p in parts)], axis=1)
    Q = np.concatenate([np.zeros((len(h), 0)), *(p.diffusion(h, still) for _, p in parts)], axis=1) * H**2
    P_0 = np.concatenate([np.zeros(0), *(p.initial() for _, p in parts)]) * H**2
    return Chains(channel.astype(int), Phi, Q, P_0, np.sqrt(P_0 + Q.sum(axis=0)))


def beside(Phi: Array, Psi: Array, Q: Array, d: Array, felt: Array, made: Chains) -> tuple[Array, Array, Array, Array]:
    """The error model of m states with the chains behind them: Phi (K, m + c, m + c), Psi, Q, d.

    felt (K, m, 6): what a constant addition to each of the readings does over a stretch.
    """
    K, m, c = len(Phi), Phi.shape[1], len(made)
    if not c:
        return Phi, Psi, Q, d
    own, none = np.arange(m, m + c), np.zeros((K, c))
    F, N = np.zeros((K, m + c, m + c)), np.zeros((K, m + c, m + c))
    F[:, :m, :m], N[:, :m, :m] = Phi, Q
    F[:, :m, m:] = felt[:, :, made.channel] * ((1 + made.Phi) / 2 * made.scale)[:, None]
    F[:, own, own] = made.Phi
    N[:, own, own] = made.Q / made.scale**2
    return F, np.concatenate([Psi, np.zeros((K, c, Psi.shape[2]))], axis=1), N, np.concatenate([d, none], axis=1)
