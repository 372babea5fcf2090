"""The library of a recording of known noise: every column is what the forward model answers to its parameter."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose.library.assemble import assemble_library, available_effects, columns_at
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.forward import predict
from gimbalcal.views.core import absent_effect
from tests.diagnose.plant import ARCSEC, UG, turned
from tests.diagnose.small import observed

O = observed(1, dwell=6)
BASE = BASELINE["multi-position"]
LIBRARY = assemble_library(O)


@pytest.mark.parametrize(
    "label", ["cubic_nonlinearity:x", "gimbal_flexure:inner", "base_tilt_drift:north", "bias_temperature_lagged:y",
              "scale_factor_asymmetry:z"],
)  # fmt: skip
def test_a_column_is_a_difference_of_two_predictions(label):
    """Half a prior sigma either way, reduced as the data are: sensors are linear to 1e-4 at such sizes."""
    c = next(c for c in LIBRARY.candidates if c.label == label)
    v = c.variants[len(c.variants) // 2]
    made = absent_effect(c.effect, O.view.stimulus, c.source, **dict(v.constants))
    for k, p in enumerate(c.parameters):
        answers = []
        for sign in (0.5, -0.5):
            (e,) = with_values([made], [p], values([made], [p]) + sign * p.sigma, O.view.stimulus.axis_names)
            answers.append(
                predict(O.view.source.platform, O.view.stimulus, (*O.effects, e), O.view.kind)["specific_force"]
            )
        X = O.reduced(((answers[0] - answers[1]) / O.sigma)[:, :, None])[:, 0]
        np.testing.assert_allclose(LIBRARY.X[:, v.index[k]], X, atol=2e-4 * np.abs(X).max())
    np.testing.assert_allclose(columns_at(O, c, v.constants), LIBRARY.X[:, list(v.index)])


def test_what_is_in_the_model_is_no_candidate():
    ids = available_effects(O.view)
    assert not set(ids) & set(BASE)
    assert {c.effect for c in LIBRARY.candidates if not c.rival} <= set(ids)
    assert "cubic_nonlinearity" not in available_effects(replace(O.view, baseline=(*BASE, "cubic_nonlinearity")))
    assert all(parameters(CATALOGUE[i], O.view.stimulus.axis_names) for i in ids)


def test_every_column_has_an_owner():
    owned = {i for c in LIBRARY.candidates for v in c.variants for i in v.index}
    shown = np.flatnonzero(np.abs(LIBRARY.X).max(axis=0) > 0)
    assert set(shown.tolist()) <= owned
    assert max(owned) < LIBRARY.X.shape[1]
    assert len(LIBRARY.X) == len(O.reduced(O.Z))


def test_of_many_places_those_that_explain_most_are_weighed_with_the_share_of_all(monkeypatch):
    o = observed(3, lambda b: turned(2, (b.visit == 6).astype(float)), dwell=6, size=60 * ARCSEC / UG)
    every = next(c for c in assemble_library(o).candidates if c.effect == "position_blunder")
    monkeypatch.setattr("gimbalcal.diagnose.library.assemble.MAX_CHOICES", 5)
    few = next(c for c in assemble_library(o).candidates if c.effect == "position_blunder")
    assert len(few.variants) == 5 < len(every.variants)
    assert few.tried == every.tried == 18
    assert (("position", 7.0),) in [v.constants for v in few.variants]
