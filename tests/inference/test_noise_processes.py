"""Whatever reads a process reads the same one: chain, spectrum and filter against its covariance."""

import numpy as np
import pytest
from scipy.fft import dct

from gimbalcal.effects.process import Flicker, GaussMarkov, RandomWalk, SettingError, WhiteNoise, covariance
from gimbalcal.inference import noise_processes
from tests.effects.test_process import EVERY, TIME

ONE_STATE = [p for p in EVERY if not isinstance(p, Flicker | SettingError)]


@pytest.mark.parametrize("process", ONE_STATE, ids=lambda p: p.id)
def test_a_chain_whitens_and_inverts_the_covariance(process):
    before = np.append(TIME[0] - np.median(np.diff(TIME)), TIME)
    V = covariance(process, before)[1:, 1:]
    found = noise_processes.chain(process, TIME)
    L = found.whiten(np.eye(len(TIME)))
    np.testing.assert_allclose(L @ V @ L.T, np.eye(len(TIME)), atol=1e-10)
    diagonal, below = found.precision
    Lambda = np.diag(diagonal) + np.diag(below, 1) + np.diag(below, -1)
    np.testing.assert_allclose(Lambda @ V, np.eye(len(TIME)), atol=1e-10)
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(V)[1], abs=1e-10)


def test_a_chain_of_several_states_is_refused():
    with pytest.raises(ValueError, match="must have one state, flicker has"):
        noise_processes.chain(Flicker(1.0), TIME)


def test_the_spectrum_of_a_walk_is_what_the_cosine_transform_makes_of_it():
    """A walk of unknown start: its precision, the first row's own taken away, is diagonal in the transform."""
    n, step, walk = 40, 60.0, RandomWalk(0.3)
    diagonal, below = noise_processes.chain(walk, step * np.arange(n)).precision
    Lambda = np.diag(diagonal) + np.diag(below, 1) + np.diag(below, -1)
    Lambda[0, 0] -= 1 / (walk.N**2 * step)
    modes = dct(np.eye(n), axis=0, norm="ortho")
    angle = np.pi * np.arange(1, n) / n
    expected = np.diag(1 / noise_processes.spectrum((walk,), step, angle))
    np.testing.assert_allclose((modes @ Lambda @ modes.T)[1:, 1:], expected, atol=1e-10 * expected.max())
    np.testing.assert_allclose((modes @ Lambda @ modes.T)[0], 0.0, atol=1e-10 * expected.max())


def test_the_spectrum_of_stationary_noise_is_the_variance_of_its_modes():
    n, step = 2000, 1.0
    every = (WhiteNoise(1.0), GaussMarkov(2.0, 5.0), Flicker(0.5, 8.0, 16.0))
    V = sum(covariance(p, step * np.arange(n)) for p in every)
    k = np.array([400, 1000, 1900])
    modes = dct(np.eye(n), axis=0, norm="ortho")[k]
    # what leaks at the two ends falls as the memory over the length: 64 / 2000
    np.testing.assert_allclose(
        np.diag(modes @ V @ modes.T), noise_processes.spectrum(every, step, np.pi * k / n), rtol=0.03
    )
