"""A process has the covariance that it says, in closed form, sampled, and in pieces."""

import numpy as np
import pytest

from gimbalcal.effects.process import (
    Flicker,
    GaussMarkov,
    Process,
    Quantisation,
    RandomWalk,
    SettingError,
    WhiteNoise,
    covariance,
    sample,
)
from gimbalcal.references import REFERENCES
from gimbalcal.units import parse

TIME = np.array([0.0, 1.0, 2.5, 2.6, 7.0, 30.0, 31.0, 90.0])
VISIT = np.array([0, 0, 0, 1, 1, 1, 2, 2])
EVERY: list[Process] = [
    WhiteNoise(2.0), Quantisation(3.0), RandomWalk(0.5), GaussMarkov(1.5, 10.0), Flicker(1.0, 1.0, 100.0),
    SettingError(0.7),
]  # fmt: skip


def closed_form(process):
    lag = np.abs(TIME[:, None] - TIME)
    same = np.eye(len(TIME))
    match process:
        case WhiteNoise():
            return process.sigma**2 * same
        case Quantisation():
            return process.q**2 / 12 * same
        case RandomWalk():
            return process.N**2 * np.minimum(TIME[:, None], TIME)
        case GaussMarkov():
            return process.sigma**2 * np.exp(-lag / process.tau)
        case Flicker():
            octave = process.B**2 * np.log(2) / np.pi
            return octave * np.exp(-lag[..., None] / process.taus).sum(axis=-1)
        case SettingError():
            return process.sigma**2 * (VISIT[:, None] == VISIT)
    raise AssertionError(process.id)


@pytest.mark.parametrize("process", EVERY, ids=lambda p: p.id)
def test_covariance_is_the_closed_form(process):
    np.testing.assert_allclose(covariance(process, TIME, VISIT), closed_form(process), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("process", EVERY, ids=lambda p: p.id)
def test_samples_have_that_covariance(process):
    rng, n = np.random.default_rng(1), 4000
    drawn = np.stack([sample(process, rng, TIME, VISIT)[0] for _ in range(n)])
    P = closed_form(process)
    size = np.sqrt(np.outer(np.diag(P), np.diag(P)) + P**2) + 1e-12
    # the sampling error of a covariance is size / sqrt(n); 64 entries, 5 sigma
    assert np.abs((drawn.T @ drawn / n - P) / size * np.sqrt(n)).max() < 5


@pytest.mark.parametrize("process", EVERY, ids=lambda p: p.id)
def test_a_record_in_pieces_goes_on_where_it_stopped(process):
    time = np.arange(12.0)
    P = covariance(process, time)
    rng, n = np.random.default_rng(2), 4000
    drawn = []
    for _ in range(n):
        first, state = sample(process, rng, time[:6])
        drawn.append(np.concatenate([first, sample(process, rng, time[6:], state=state)[0]]))
    if isinstance(process, SettingError):
        assert all(np.ptp(y) == 0 for y in drawn)  # no move, no new setting
    found, size = np.cov(np.array(drawn).T), np.sqrt(np.outer(np.diag(P), np.diag(P)) + P**2) + 1e-12
    assert np.abs((found - P) / size * np.sqrt(n)).max() < 5


def test_flicker_has_the_flat_allan_deviation_of_ieee_952():
    process = Flicker(1.0, 1.0, 4096.0)
    floor = np.sqrt(2 * np.log(2) / np.pi)
    for m in (8, 32, 128):
        P = covariance(process, np.arange(2.0 * m))
        weight = np.repeat([-1.0, 1.0], m) / m
        # the sum of octaves ripples, and the corners are a factor 8 away or more: 3 %
        assert np.sqrt(weight @ P @ weight / 2) == pytest.approx(floor, rel=0.03)


def test_quantisation_rounds_to_whole_steps():
    x = np.random.default_rng(3).uniform(-100, 100, 20000)
    error = Quantisation(3.0).rounded(x) - x
    assert np.abs(error).max() <= 1.5
    assert error.std() == pytest.approx(3 / np.sqrt(12), rel=0.02)  # 20000 samples know it to 0.4 %


@pytest.mark.parametrize("cls", Process.__subclasses__())
def test_a_process_has_a_card(cls):
    assert cls.id
    assert ".. math::" in (cls.__doc__ or "")
    assert set(cls.sources) <= set(REFERENCES)
    parse(cls.unit)
