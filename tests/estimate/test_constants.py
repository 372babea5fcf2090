"""Nonlinear constants as parameters: estimates scatter about the truth by the sigmas that are reported with them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, Effect, parameters, with_values
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, multiposition, norm_fit
from gimbalcal.estimate.extra_effects import Extension, extra_effects
from gimbalcal.pipeline import three_stage
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.views.norm import norm
from gimbalcal.views.positions import view_of_positions
from tests.diagnose.plant import ARCSEC, UG, record
from tests.estimate.accelerometers.test_multiposition import rested, scattered
from tests.estimate.device import NOISE, outputs
from tests.estimate.static_runs import run

DRAWS = 12


def positions(truth, rng):
    """18 positions of 12 s with the stated noise of samples and settings."""
    blank = record(rng, dwell=12)
    view = view_of_positions(blank, NOISE, averaged=False)
    e = ARCSEC * rng.standard_normal(view.local.zero_values.shape)
    force = outputs(view, truth, e) + 20 * UG * rng.standard_normal((len(view), 3))
    return blank.with_channels({("specific_force", a): force[:, i] for i, a in enumerate("xyz")})


def norms(truth, rng):
    """40 rests at unknown attitudes, one a minute."""
    return rested(truth, scattered(40), seed=int(rng.integers(2**31)))


def static_run(truth, rng):
    """A day of a space-stable platform."""
    return run(truth, rng, hours=24.0, step=900.0)


@dataclass(frozen=True)
class Case:
    """An effect as it is asked for, with true values in SI by label, and how it is measured and calibrated."""

    word: str
    truth: dict[str, float]
    measure: Callable[[tuple[Effect, ...], np.random.Generator], Recording]

    def effects(self):
        cls = CATALOGUE[self.word.partition(":")[0]]
        by_label = {p.label: p for p in parameters(cls, ("platform", "inner", "middle"), constants=True)}
        return with_values((), [by_label[label] for label in self.truth], np.array([*self.truth.values()]))

    def calibrated(self, recording):
        more = extra_effects([self.word], [recording])
        return multiposition(recording, LINEAR, more) if self.measure is norms else three_stage([recording], more=more)

    def deviations(self, draws, seed=0):
        """(estimate - truth) / sigma (draws, p) of size and constant, and the mean correlation of the two."""
        out, together = [], []
        for i in range(draws):
            made = self.calibrated(self.measure(self.effects(), np.random.default_rng([seed, i])))
            at = [[p.label for p in made.parameters].index(label) for label in self.truth]
            sigma = made.sigmas[at]
            out.append((made.values[at] - np.array([*self.truth.values()])) / np.where(sigma > 0, sigma, np.nan))
            together.append(made.covariance[at[0], at[-1]] / sigma[0] / sigma[-1])
        return np.array(out), float(np.mean(together))


CASES = {
    "warm-up at positions": Case("warm_up:y", {"warm_up:y": 3e-3, "warm_up.tau": 150.0}, positions),
    "lag of temperature at positions": Case(
        "bias_temperature_lagged:z", {"b_L:z": 300 * UG, "bias_temperature_lagged.tau": 600.0}, positions
    ),
    "soft saturation by the norm": Case(
        "soft_saturation:z", {"saturation:z": 4e-4, "soft_saturation.f_0": 6.0}, norms
    ),
    "warm-up by the norm": Case("warm_up:y", {"warm_up:y": 3e-3, "warm_up.tau": 700.0}, norms),
    "Schuler oscillation in a static run": Case(
        "schuler_oscillation",
        {"schuler_sin:roll": 2 * ARCSEC, "schuler_cos:pitch": 1.5 * ARCSEC, "schuler_oscillation.period": 5064.0,
         "schuler_oscillation.damping": 1e-5},
        static_run,
    ),
    "tide of gravity in a static run": Case(
        "gravity_tide", {"gravity_tide_sin": 1e-4, "gravity_tide_cos": 1e-4, "gravity_tide.period": 45500.0}, static_run
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_size_and_constant_scatter_by_their_sigmas(name):
    z, correlation = CASES[name].deviations(DRAWS)
    rms = np.sqrt((z**2).mean(axis=0))
    # the rms of 12 normal draws is within 0.45 and 1.6 in 999 of 1000 cases
    assert np.all((rms > 0.45) & (rms < 1.6)), dict(zip(CASES[name].truth, rms, strict=True))
    assert abs(correlation) > 0.1  # a sigma of the size that ignored the constant would be too small


def test_a_constant_that_is_stated_is_held():
    case = CASES["warm-up by the norm"]
    recording = case.measure(case.effects(), np.random.default_rng(5))
    free, held = (
        multiposition(recording, LINEAR, extra_effects([word], [recording]))
        for word in ("warm_up:y", f"warm_up:y,tau={700 / 3600}")
    )
    at = {p.label: i for i, p in enumerate(free.parameters)}
    assert [p.label for p in held.parameters] == [p.label for p in free.parameters]
    tau, size = at["warm_up.tau"], at["warm_up:y"]
    assert held.values[tau] == pytest.approx(700.0)
    assert not held.covariance[tau].any()
    assert free.sigmas[tau] > 0
    assert free.sigmas[size] > 1.02 * held.sigmas[size]


def test_the_start_does_not_matter():
    case = CASES["warm-up by the norm"]
    recording = case.measure(case.effects(), np.random.default_rng(6))
    (e,) = extra_effects(["warm_up:y"], [recording])
    sizes, tau = e.parameters(()), next(p for p in parameters(CATALOGUE["warm_up"], constants=True) if p.field == "tau")
    means = dwell_means(dwell_means(recording))
    fits = [
        norm_fit(norm(means), LINEAR, Extension((e.absent((), {"tau": t}),), (*sizes, replace(tau, mean=t))))
        for t in (300.0, 700.0, 3000.0)
    ]
    first = fits[0].solution
    for other in fits[1:]:
        np.testing.assert_allclose(other.solution.x, first.x, atol=0.02 * first.sigma.min(), rtol=1e-3)
        np.testing.assert_allclose(other.solution.sigma, first.sigma, rtol=0.01)


def test_both_recordings_determine_one_constant():
    truth = CASES["warm-up at positions"].effects()
    rng = np.random.default_rng(7)
    table, still = positions(truth, rng), run(truth, rng, hours=24.0, step=100.0)
    recordings = [table, still]
    made = three_stage(recordings, more=extra_effects(["warm_up:y"], recordings))
    alone = [three_stage([r], more=extra_effects(["warm_up:y"], [r])) for r in recordings]
    at = [[p.label for p in c.parameters].index("warm_up.tau") for c in (made, *alone)]
    sigma = [c.sigmas[i] for c, i in zip((made, *alone), at, strict=True)]
    assert sigma[0] <= 1.01 * min(sigma[1:])
    assert made.values[at[0]] == pytest.approx(150.0, abs=4 * sigma[0])
