"""Channels with scales of their own: the evidence is that of numerical integration over all scales and sizes."""

import itertools

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.channel_scales import (
    PRODUCTS,
    SPREAD,
    ChannelProducts,
    contrasts,
    likeliest_scales,
    log_odds,
    products_of_noises,
)
from gimbalcal.diagnose.evidence.correlated_noise import POLES, noises_of_channels, noises_of_unknown_scale
from gimbalcal.diagnose.evidence.projection import gather_evidence, project, project_all, stacked_rows
from gimbalcal.diagnose.evidence.scale import _DENSITY, Channels, Free
from gimbalcal.diagnose.library.candidates import Candidate, Variant, layout_of
from gimbalcal.diagnose.search.ranking import bayes_factors
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.views.noise import of_channels

n = 60


def example(sigma, size, seed):
    """Misfit (n C,) of unit rms, five modelled columns that all channels share, and a wave in the first channel."""
    rng, C = np.random.default_rng(seed), len(sigma)
    J, X = rng.standard_normal((n * C, 5)), np.zeros((n, C))
    X[:, 0] = np.sin(0.7 * np.arange(n))
    r = (rng.standard_normal((n, C)) * sigma + size * X).ravel()
    Q = np.linalg.qr(J)[0]
    r = r - Q @ (Q.T @ r)
    return r / r.std(), J, X.reshape(-1, 1) / r.std()


def layout(X):
    return layout_of([Candidate("wave", "", (), (Variant((), tuple(range(X.shape[1]))),))])


def weighed(r, J, X, C, divided=(), sample=()):
    """Projections in white noise of rows whose channels were divided by scales before."""
    scales = divided or (1.0,) * C
    d = np.resize(scales, len(r))[:, None]
    Q = np.linalg.qr(J / d)[0]
    channels = Channels(scales, tuple(a / b for a, b in zip(sample, scales, strict=False)))
    scale = Free(len(r) - Q.shape[1], float(np.sqrt(np.mean(np.square(sample or 0.0)))), channels=channels)
    return project_all(
        noises_of_unknown_scale(n, C)[:1], stacked_rows(Q, X / d, r[:, None] / d, len(r), scale), layout=layout(X)
    )


def ln_bayes(p, X):
    return float(bayes_factors(p, layout(X))[1][0])


def ln_odds_of_scales(p):
    """Ln odds of scales of their own to one scale, without a cause."""
    ln, alike = np.array([q.log_evidence() for q in p]), np.array([q.node.prior == 0.25 for q in p])
    return float(logsumexp(ln[~alike]) - logsumexp(ln[alike]))


def integrated(r, J, X, C, values):
    """Ln Bayes factor and ln odds of scales by sums over contrasts of ln scales, the common scale and the size."""
    free = np.linalg.svd(J)[0][:, J.shape[1] :]
    y, x = free.T @ r, (free.T @ X)[:, 0]
    sizes = np.exp(np.linspace(np.log(0.03), np.log(100), 60))
    share = np.interp(np.log(sizes), *_DENSITY)
    share = np.log(np.maximum(share / share.sum(), 1e-300))[:, None]

    def at(scales):
        V = free.T @ (np.resize(scales**2, len(r))[:, None] * free)
        L = np.linalg.cholesky(V)
        yw, xw = np.linalg.solve(L, y), np.linalg.solve(L, x)
        m, b, g, det = yw @ yw, xw @ yw, xw @ xw, np.log(np.diag(L)).sum()
        s = np.exp(np.linspace(-4, 4, 160)) * np.sqrt(m / len(y))
        none = -len(y) * np.log(s) - m / (2 * s**2)
        lam = (sizes[:, None] / s) ** 2 * g
        cause = share + none - 0.5 * np.log1p(lam) + 0.5 * (sizes[:, None] * b / s**2) ** 2 / (1 + lam)
        return float(logsumexp(none)) - det, float(logsumexp(cause)) - det

    density = np.log(values[1] - values[0]) - 0.5 * np.log(2 * np.pi) - np.log(SPREAD)
    own = [
        np.add(at(np.exp(t @ contrasts(C))), (C - 1) * density - t @ t / (2 * SPREAD**2))
        for t in map(np.array, itertools.product(values, repeat=C - 1))
    ]
    separate, alike = logsumexp(np.array(own), axis=0), np.array(at(np.ones(C)))
    ln = np.logaddexp(separate, alike)
    return float(ln[1] - ln[0]), float(separate[0] - alike[0])


@pytest.mark.parametrize(
    ("sigma", "size"),
    [((1, 5), 0.0), ((1, 5), 0.6), ((1, 5), 1.0), ((1, 5), 2.0), ((1, 1), 0.5), ((1, 1), 2.0), ((1, 1), 15.0)],
)
def test_two_channels_weigh_what_integration_over_both_scales_says(sigma, size):
    r, J, X = example(sigma, size, 3)
    truth, odds = integrated(r, J, X, 2, np.linspace(-4, 4, 161))
    for divided in ((), sigma):  # whatever the rows were divided by
        p = weighed(r, J, X, 2, divided)
        assert ln_bayes(p, X) == pytest.approx(truth, abs=0.15, rel=2e-3)
        assert ln_odds_of_scales(p) == pytest.approx(odds, abs=0.1)


@pytest.mark.parametrize(("sigma", "size"), [((1, 1, 5), 0.7), ((1, 1, 1), 0.0)])
def test_three_channels_weigh_what_integration_over_all_scales_says(sigma, size):
    r, J, X = example(sigma, size, 5)
    truth, odds = integrated(r, J, X, 3, np.linspace(-2.4, 2.4, 49))
    p = weighed(r, J, X, 3)
    assert ln_bayes(p, X) == pytest.approx(truth, abs=0.15)
    assert ln_odds_of_scales(p) == pytest.approx(odds, abs=0.2)


def test_a_cause_in_a_quiet_channel_shows_beside_a_noisy_one():
    """One scale for both channels sees nothing of it."""
    found, one = [], []
    for seed in range(8):
        r, J, X = example((1, 5), 0.9, seed)
        found.append(ln_bayes(weighed(r, J, X, 2), X))
        Q = np.linalg.qr(J)[0]
        single = project(noises_of_unknown_scale(n, 2)[0], stacked_rows(Q, X, r[:, None], len(r), Free(len(r) - 5)))
        one.append(float(gather_evidence((single,), layout(X))[0, 0]))
    assert np.median(found) > 5
    assert np.median(one) < 0.5


def test_where_channels_scatter_alike_one_scale_is_likelier():
    """And what the data say of a cause is then what they say with one scale."""
    odds = []
    for seed in range(12):
        r, J, X = example((1, 1), 0.8, seed)
        p = weighed(r, J, X, 2)
        odds.append(ln_odds_of_scales(p))
        Q = np.linalg.qr(J)[0]
        single = project(noises_of_unknown_scale(n, 2)[0], stacked_rows(Q, X, r[:, None], len(r), Free(len(r) - 5)))
        assert ln_bayes(p, X) == pytest.approx(float(gather_evidence((single,), layout(X))[0, 0]), abs=1.0)
    assert np.median(odds) < -1.5


@pytest.mark.parametrize("sample", [(), (0.05, 0.2)])
def test_odds_in_closed_form_are_those_of_the_lattice(sample):
    for seed, sigma in enumerate([(1, 1), (1, 1.5), (1, 4)]):
        r, J, X = example(sigma, 0.0, seed)
        expected = ln_odds_of_scales(weighed(r, J, X, 2, sigma, sample))

        def left(scales, r=r, J=J):
            d = np.resize(scales, len(r))
            Q = np.linalg.qr(J / d[:, None])[0]
            e = (r / d - Q @ (Q.T @ (r / d))) * d
            return (e.reshape(n, 2) ** 2).sum(axis=0), n - (Q**2).sum(axis=1).reshape(n, 2).sum(axis=0)

        own = np.ones(2)
        for _ in range(10):
            misfit, dof = left(own)
            own = np.sqrt(misfit / dof)
        assert log_odds(left(np.ones(2)), left(own), sample) == pytest.approx(expected, abs=0.3, rel=0.05)
        scales = likeliest_scales(r.reshape(n, 2), J.reshape(n, 2, -1), sample)
        assert (scales is None) == (log_odds(left(np.ones(2)), left(own), sample) < 0)
        if scales is not None:
            np.testing.assert_allclose(scales, own, rtol=5e-3)


def test_a_channel_without_noise_has_no_scale():
    r, J, X = example((1, 1), 0.0, 0)
    r.reshape(n, 2)[:, 1] = 0.0
    J.reshape(n, 2, 5)[:, 1] = 0.0
    assert likeliest_scales(r.reshape(n, 2), J.reshape(n, 2, -1)) is None
    assert len(weighed(r, J, X, 2)) == 1


@pytest.mark.parametrize("memory", [0.0, 0.8])
@pytest.mark.parametrize("sigma", [(1.0, 1.0), (1.0, 6.0), (1.0, 1.0, 1.0), (1.0, 3.0, 10.0)])
def test_claims_on_clean_channels_are_rare(sigma, memory):
    """20 to one in at most one of twenty, over the scales and the memory of the channels."""
    rng, C = np.random.default_rng(6), len(sigma)
    nodes = noises_of_unknown_scale(n, C, of_channels(n, C))
    root = np.linalg.cholesky(memory ** np.abs(np.subtract.outer(np.arange(n), np.arange(n))))
    ln = []
    for _ in range(20):
        J, X = np.kron(np.ones((n, 1)), np.eye(C)), rng.standard_normal((n * C, 1))
        r = (root @ rng.standard_normal((n, C)) * sigma).ravel()
        Q = np.linalg.qr(J)[0]
        r = r - Q @ (Q.T @ r)
        rows = stacked_rows(Q, X, r[:, None] / r.std(), len(r), Free(len(r) - C, channels=Channels((1.0,) * C)))
        ln.append(ln_bayes(project_all(nodes, rows, layout=layout(X)), X))
    assert np.mean(np.array(ln) > np.log(20)) <= 0.05


def test_the_noise_of_second_order_has_the_covariance_of_its_poles():
    """Whitened by the recursion itself, r_k - (a + b) r_{k-1} + a b r_{k-2}, beyond the first two rows."""
    r = np.random.default_rng(2).standard_normal((n, 1))
    for node in noises_of_channels(n, 1)[: len(POLES)]:
        a, b = (x for _, x in node.name)
        new = (r[2:] - (a + b) * r[1:-1] + a * b * r[:-2]) / np.sqrt((1 - a**2) * (1 - b**2))
        assert np.allclose(node.whiten(r)[2:], new)
        root = node.whiten(np.eye(n))
        assert -2 * np.linalg.slogdet(root)[1] == pytest.approx(node.logdet)


def test_channels_with_noises_of_their_own_have_the_products_of_the_rows_that_these_whiten():
    rows, channels = np.random.default_rng(3).standard_normal((2 * n, 6)), Channels((1.0, 2.0))
    every = noises_of_channels(n, 2)
    some = [every[k] for k in (0, 7, 100, len(every) - 1)]
    for node, made in zip(some, products_of_noises(some, rows, 2, 3, channels), strict=True):
        direct = ChannelProducts.of(node, rows, 2, 3, channels)
        assert all(np.allclose(getattr(made, name), getattr(direct, name)) for name in (*PRODUCTS, "xx"))
        sign, ln = np.linalg.slogdet(node.whiten(np.eye(2 * n)))
        assert sign > 0
        assert -2 * ln == pytest.approx(node.logdet)
    assert sum(node.prior for node in every) == pytest.approx(1.0)


def test_noises_that_share_the_part_of_a_channel_share_the_products_of_its_columns():
    """Hundreds of noises are pairs of some twenty parts: copies of the largest products took 1.7 GB of a guide log."""
    rows, channels = np.random.default_rng(4).standard_normal((2 * n, 6)), Channels((1.0, 2.0))
    first, second = (node for node in noises_of_channels(n, 2)[-2:])
    assert first.channels[0] is second.channels[0]
    one, other = products_of_noises([first, second], rows, 2, 3, channels)
    assert np.shares_memory(one.xx[0], other.xx[0])
    assert not np.shares_memory(one.xx[1], other.xx[1])


def test_the_likeliest_scales_of_a_noise_are_those_at_which_each_channel_scatters_as_much_as_stated():
    rows, channels = np.random.default_rng(5).standard_normal((2 * n, 6)), Channels((1.0, 2.0))
    rows[1::2, -1] *= 3.0
    every = noises_of_channels(n, 2)
    some = [every[k] for k in (0, 7, 100, len(every) - 1)]
    for node, made in zip(some, products_of_noises(some, rows, 2, 3, channels), strict=True):
        log_scales, _ = made.likeliest
        scaled = (node.whiten(rows).reshape(n, 2, 6) / np.exp(log_scales)[:, None]).reshape(2 * n, 6)
        Q = np.linalg.qr(scaled[:, :2])[0]
        left = (scaled[:, -1] - Q @ (Q.T @ scaled[:, -1])).reshape(n, 2)
        scatter = np.sqrt((left**2).sum(axis=0) / (n - (Q**2).sum(axis=1).reshape(n, 2).sum(axis=0)))
        assert scatter[1] / scatter[0] == pytest.approx(1.0, abs=1e-3)
