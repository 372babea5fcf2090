r"""Coloured sensor noise as states of the filter, from the processes that `[noise]` of a recording states.

A chain of a process (`effects.process`) adds its value x to the readings of one channel. Over a stretch its mean is
taken between where it begins and where it tends, :math:`\tfrac{1}{2} (1 + \Phi) x`, and it moves on at the end:

.. math:: x_{k+1} = \Phi(h_k) x_k + w_k, \qquad w_k \sim N(0, Q(h_k))

Within a stretch it acts on the navigator as a constant addition to the reading does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording.noise_levels import coloured
from gimbalcal.views.segments import CHANNELS, Segments

SHORTEST_PERIOD_S = 2.0  # flicker of shorter periods is below the white noise of any instrument


@dataclass(frozen=True, eq=False)
class BiasProcesses:
    """c chains in SI that follow the navigation states.

    channel (c,): the reading that each adds to; Phi, Q (K, c) over each stretch; P_0 (c,) at the start; scale (c,):
    their size by the end of the recording.
    """

    channel: Array
    Phi: Array
    Q: Array
    P_0: Array
    scale: Array

    def __len__(self) -> int:
        return len(self.channel)


def bias_processes(segments: Segments) -> BiasProcesses:
    """Return the chains of all six channels; none where the header states white noise alone."""
    h = np.diff(segments.time)
    moved = np.zeros(len(h), dtype=bool)
    stated = coloured(segments.rows, SHORTEST_PERIOD_S, float(h.sum()))
    parts = [(i, process) for i, (quantity, _) in enumerate(CHANNELS) for process in stated.get(quantity, ())]
    channel = np.concatenate([np.zeros(0, dtype=int), *(np.full(len(p.output()), i) for i, p in parts)])
    H = np.concatenate([np.zeros(0), *(p.output() for _, p in parts)])
    Phi = np.concatenate([np.zeros((len(h), 0)), *(p.transition(h, moved) for _, p in parts)], axis=1)
    Q = np.concatenate([np.zeros((len(h), 0)), *(p.diffusion(h, moved) for _, p in parts)], axis=1) * H**2
    P_0 = np.concatenate([np.zeros(0), *(p.initial() for _, p in parts)]) * H**2
    return BiasProcesses(channel.astype(int), Phi, Q, P_0, np.sqrt(P_0 + Q.sum(axis=0)))


def augment(
    Phi: Array, Psi: Array, Q: Array, d: Array, additions: Array, processes: BiasProcesses
) -> tuple[Array, Array, Array, Array]:
    """Append the chains to an error model of m states: Phi (K, m + c, m + c), Psi, Q, d.

    additions (K, m, 6): response of the states to a constant addition to each reading over a stretch.
    """
    K, m, c = len(Phi), Phi.shape[1], len(processes)
    if not c:
        return Phi, Psi, Q, d
    own, none = np.arange(m, m + c), np.zeros((K, c))
    F, N = np.zeros((K, m + c, m + c)), np.zeros((K, m + c, m + c))
    F[:, :m, :m], N[:, :m, :m] = Phi, Q
    F[:, :m, m:] = additions[:, :, processes.channel] * ((1 + processes.Phi) / 2 * processes.scale)[:, None]
    F[:, own, own] = processes.Phi
    N[:, own, own] = processes.Q / processes.scale**2
    return F, np.concatenate([Psi, np.zeros((K, c, Psi.shape[2]))], axis=1), N, np.concatenate([d, none], axis=1)
