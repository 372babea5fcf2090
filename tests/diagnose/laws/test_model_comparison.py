"""Laws beside a known cause: the model that has the cause in it is a model of its own."""

from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.laws.model_comparison import with_cause
from gimbalcal.diagnose.search.ranking import search
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.views.pointing import pointing
from tests.diagnose.small import telescope


def test_channels_have_the_scales_that_a_cause_leaves_them():
    """A tube bends by 400 arcsec, which is all that one channel lacks: with it both channels scatter alike."""
    v = pointing(telescope(6, bend=400.0))
    s = search(start_with_baseline(replace(v, noise=replace(v.noise, of_each_channel=True))))
    (flexure,) = (k for k, c in enumerate(s.library.candidates) if c.effect == "tube_flexure")
    beside = with_cause(s, (flexure,))
    for made, differ in ((s, True), (beside, False)):
        own = np.log(made.rows.scale.channels.scale)
        assert bool(np.ptp(own) > 1) is differ
        alike = np.exp(own.mean() - own)
        assert sum(np.allclose(p.node.scales, alike) for p in made.projections) >= 12  # one of each noise
