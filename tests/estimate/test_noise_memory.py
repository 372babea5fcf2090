"""Covariances of fits whose rows remember each other: errors are as large as stated; independent rows keep theirs."""

from types import SimpleNamespace

import numpy as np
import pytest

from gimbalcal.estimate.gyroscopes.against_attitude import fit_thirds
from gimbalcal.estimate.noise_memory import added_by_memory
from gimbalcal.p_value import SIGNIFICANCE
from tests.stimuli import remembering

N = 200


def noise(rng, memory, share):
    """Rows (N,) of unit variance, of which a share remembers the row before."""
    slow = remembering(rng.standard_normal(N), memory)
    return np.asarray(np.sqrt(share) * slow + np.sqrt(1 - share) * rng.standard_normal(N))


def ratios(memory, share):
    """Rms of errors over sigmas of independent rows and of rows with memory: of a mean, a slope and a fast column."""
    rng = np.random.default_rng(5)
    J = np.column_stack([np.ones(N), np.linspace(-1, 1, N), rng.standard_normal(N)])
    G, of_independent, of_memory = np.linalg.inv(J.T @ J), [], []
    for _ in range(150):
        y = noise(rng, memory, share)
        x = G @ J.T @ y
        r = y - J @ x
        s = np.sqrt(r @ r / (N - 3))
        of_independent.append(x / s / np.sqrt(np.diag(G)))
        of_memory.append(x / s / np.sqrt(np.diag(G + added_by_memory(J, r / s, G))))
    return (np.sqrt(np.mean(np.square(of_independent), axis=0)), np.sqrt(np.mean(np.square(of_memory), axis=0)))


@pytest.mark.parametrize(("memory", "share"), [(0.8, 0.5), (0.9, 0.9), (0.95, 0.4)])
def test_errors_are_as_large_as_stated_where_rows_remember(memory, share):
    before, after = ratios(memory, share)
    assert before[:2].min() > 1.8
    assert after.max() < 1.35
    assert after.min() > 0.85
    assert after[2] == pytest.approx(before[2], rel=0.1)  # a column that changes from row to row averages as before


def test_thirds_of_rows_that_remember_are_alike():
    """A mean and a wave in 1500 rows: by independent sigmas most records differ from third to third, by these few."""
    rng, n = np.random.default_rng(2), 1500
    J = np.column_stack([np.ones(n), np.sin(np.arange(n) / 7.0)])
    G = np.linalg.inv(J.T @ J)
    view = SimpleNamespace(local=None, time=np.arange(float(n)), source=SimpleNamespace(time=[0.0]), channels=("x",))
    own = tuple(SimpleNamespace(effect="bias", axis=axis, name="bias") for axis in "xy")
    p_values: list[list[float]] = [[], []]
    for _ in range(40):
        y = remembering(rng.standard_normal(n), 0.9) + 0.3 * rng.standard_normal(n)
        r = y - J @ (x := G @ J.T @ y)
        s = np.sqrt(r @ r / (n - 2))
        widening = np.sqrt(np.diag(G + added_by_memory(J, r / s, G)) / np.diag(G))
        for each, wide in zip(p_values, (np.ones(2), widening), strict=True):
            fitted = SimpleNamespace(views=(view,), whitened=(J, r), widening=wide,
                                     solution=SimpleNamespace(x=x, parameters=own))  # fmt: skip
            each.append(fit_thirds(fitted).p_value())
    assert np.mean(np.array(p_values[0]) < SIGNIFICANCE) > 0.5
    assert np.mean(np.array(p_values[1]) < SIGNIFICANCE) < 0.06


def test_independent_rows_keep_their_sigmas():
    before, after = ratios(0.5, 0.0)
    assert after == pytest.approx(before, rel=0.12)


def test_the_covariance_is_that_of_the_noise_in_a_long_record():
    """Against the sum over all pairs of rows, J^T V J, with the noise that made them."""
    rng, memory, share = np.random.default_rng(1), 0.9, 0.9
    J = np.ones((N, 1))
    G = np.linalg.inv(J.T @ J)
    K = memory ** np.abs(np.subtract.outer(np.arange(N), np.arange(N)))
    exact = float((G @ J.T @ ((1 - share) * np.eye(N) + share * K) @ J @ G)[0, 0])
    stated = []
    for _ in range(60):
        r = noise(rng, memory, share)
        r = r - r.mean()
        s2 = r @ r / (N - 1)
        stated.append(s2 * float((G + added_by_memory(J, r / np.sqrt(s2), G))[0, 0]))
    assert np.median(stated) == pytest.approx(exact, rel=0.35)


def test_few_rows_show_no_memory():
    J = np.ones((5, 1))
    assert not added_by_memory(J, np.array([1.0, 1, -1, -1, 0]), np.eye(1)).any()


def test_a_channel_that_shows_nothing_adds_nothing():
    assert not added_by_memory(np.zeros((20, 2)), np.linspace(-1, 1, 20), np.eye(2)).any()
