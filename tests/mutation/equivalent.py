"""Mutants that compute the same as the code: no test can tell them, and here stands why."""

from collections.abc import Mapping

EQUIVALENT: Mapping[tuple[str, str], str] = {
    (
        "effects.gimbal.GimbalZero.contribution",
        "return np.asarray(self.theta_0) / np.array(s.sense or 1) + 0 * s.readout",
    ): "a sense is 1 or -1",
    (
        "effects.history._first_order_lag",
        (
            "return recursion(np.concatenate([np.zeros(1), a]), "
            "np.concatenate([0 * x[:1], np.diff(x) / h / tau * (1 - a)]))"
        ),
    ): "its one user takes a ratio of two of them",
    (
        "effects.history.slope",
        "h = np.where(high > low, time[high] - time[low], 2.0)",
    ): "where a dwell has one row the difference over it is zero",
    (
        "estimate.accelerometers.coarse.coarse",
        "fit = ViewsFit((view,), absent, effects, solution, (np.zeros(1),), 2, local=(setting,))",
    ): "steps are counted, and asked only whether there are none",
    (
        "estimate.accelerometers.position_fit.residual_noise",
        (
            "minima = [minimize(cost, start - shift, method='Nelder-Mead', options={'xatol': 0.001}) "
            "for shift in (0.0, 4.0)]"
        ),
    ): "another start of the same search",
    (
        "estimate.accelerometers.position_fit.residual_noise",
        "{'xatol': -0.001}",
    ): "the search ends later, at the same minimum",
    (
        "estimate.accelerometers.position_fit._with_sizes",
        "return replace(noise, **dict(zip(names, np.exp(np.clip(logs, -56, 0)).tolist(), strict=True)))",
    ): "no noise is as small as either bound",
    (
        "views.local.Local.start",
        "e = apply_matrix(eliminate(linear, 2.0, self.sigma ** 2).gain, linear.r)",
    ): "where the fit begins",
}
