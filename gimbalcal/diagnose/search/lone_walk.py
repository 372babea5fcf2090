r"""One accelerometer that wanders further than any noise of the grid: it competes with what would be named instead.

Its walk has no law that a column could hold. What of it the calibration leaves is in the fast part: twelve cosines, the
first twelve terms of its series, leave half of what shows. It is a covariance, and stands among the noises: a cause is
then claimed against it as against any noise, and sizes beside it carry what it leaves open.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.evidence.noise import Node, lone_walks
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.projection import project, rows_like
from gimbalcal.diagnose.search.ranking import Search
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array

MOST = 12  # of these noises, the likeliest: each is as much work as one of the grid
CLOSE = 5.0  # nats behind the likeliest within which they count


def wandering(s: Search) -> tuple[Node, ...]:
    """The noises of one wandering accelerometer that are as likely as a twentieth of what was found, likeliest first.

    None where nothing was found: then no noise needs to be larger than those of the grid.
    """
    if s.ln_total < CLAIM:
        return ()
    nodes = lone_walks(s.o)
    ln = weights(s, nodes)
    if not len(ln) or logsumexp(ln) - logsumexp(s.null) < s.ln_total - CLAIM:
        return ()
    best = np.argsort(-ln)[:MOST]
    return tuple(nodes[int(k)] for k in best if ln[k] > ln.max() - CLOSE)


def weights(s: Search, nodes: Sequence[Node]) -> Array:
    """ln prior x likelihood (nodes,) of nothing missing in these noises."""
    bare = rows_like(s.rows, np.zeros((len(s.rows.Q), 0)))
    return np.array([np.log(n.prior) + project(n, bare).log_likelihood()[0] for n in nodes])
