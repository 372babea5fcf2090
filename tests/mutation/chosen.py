"""Mistakes that a careful engineer fears, where no rule finds them: what stands there, and what somebody might write.

Each is noticed by the tests that it stands under, and these are named as narrowly as a run takes to stay short.
"""

from collections.abc import Iterator, Mapping

from tests.mutation.rewrite import Mutant, mistaken
from tests.mutation.running import Tests

Mistake = tuple[str, str, str, str]  # module, function, what stands there once, what stands there instead

CHOSEN: Mapping[str, tuple[Mistake, ...]] = {  # by the tests, under tests/, that ought to notice
    "history/test_parameter_history.py history/test_compare.py": (
        ("history.parameter_history", "parameter_history", "still[k - 1]", "still[k - 2]"),
        ("history.parameter_history", "parameter_history", "SIGNIFICANCE / 2 / n", "SIGNIFICANCE / n"),
        ("history.parameter_history", "_one_by_one", "< 0}", "> 0}"),
        ("history.parameter_history", "_weighted_mean", "1 / np.sqrt(w.sum())", "1 / w.sum()"),
        ("history.parameter_history", "_with_step", ">= k", "> k"),
        ("history.compare", "UnitComparison.significant", "SIGNIFICANCE / len(self.steps)", "SIGNIFICANCE"),
        ("history.compare", "UnitComparison.due", "first = min(", "first = max("),
    ),
    "history/test_compare.py": (
        ("history.compare", "compare", "at, time[at], x", "at, time[: len(at)], x"),
        ("history.compare", "_step", "b.values[j] - a.values[i]", "b.values[j] + a.values[i]"),
        ("words.history_sentences", "_change_sentence", "c.rate * YEAR, c.rate_sigma * YEAR", "c.rate, c.rate_sigma"),
    ),
    "history/test_fleet.py": (
        ("history.fleet", "_posterior", "np.log(W)) / 2", "0) / 2"),
        ("history.fleet", "tail_of_others", "without_each=True", "without_each=False"),
        ("history.fleet", "_distribution", "> MAX_OUTSIDE * len(x)", "> len(x)"),
        ("history.fleet", "with_fleet", "+ e**2 * np.outer(u, u)", ""),
        ("history.fleet", "with_fleet", "np.where(null, 0.0, 1 / lam)", "1 / lam"),
        ("history.fleet", "fleet_of_store", "not rests_on_fleet(c)", "True"),
    ),
    "history/test_unit_store.py": (
        ("words.history_sentences", "day_in_words", "%Y-%m-%d %H:%M:%S", "%Y-%d-%m %H:%M:%S"),
        (
            "history.unit_store",
            "dated_calibrations",
            'e.content.get("provenance", {}).get("created") or e.date',
            "e.date",
        ),
        ("history.unit_store", "date_of", "date.replace(tzinfo=UTC)", "date.astimezone(UTC)"),
        ("history.unit_store", "_content_digest", 'k != "created"', 'k != "recordings"'),
    ),
    "recording/test_dwells.py": (
        ("recording.detection", "detect_rests", "max(m, SHORTEST_DWELL / step)", "2"),
        ("recording.detection", "detect_rests", "np.array(moves) <= most", "True"),
        ("recording.detection", "_short_and_long", "within + between", "within"),
        ("recording.detection", "_unmoved_stretches", "> noise", "> 100 * noise"),
        ("recording.detection", "_threshold", "max(THRESHOLD,", "min(THRESHOLD,"),
        ("recording.detection", "_turning_rows", "np.sqrt(variance[windows])", "variance[windows]"),
        ("recording.detection", "_turning_rows", "np.subtract(mean, np.median(x[some]), out=mean)", "mean"),
        ("recording.detection", "_window_statistics", "about += level", "about += 0"),
        ("recording.dwell", "whole_means", "weight.max() / 2", "weight.max() * 2"),
        ("recording.dwell", "usual_step", "way = p == 0", "way = p > 0"),
        ("recording.dwell", "_weighted_mean", "(off * weight).sum() / weight.sum()", "off.mean()"),
        ("recording.dwell", "_weighted_mean", "2 * np.pi * np.round(off / (2 * np.pi))",
        "np.pi * np.round(off / np.pi)"),
        ("recording.dwell", "rests_are_means", "> MEANS *", "< MEANS *"),
    ),
    "estimate/pointing/test_term_tests.py": (
        ("estimate.pointing.term_tests", "_Tests._test", "max(gain, 0.0) / k", "max(gain, 0.0)"),
        ("estimate.pointing.term_tests", "_Tests.of_candidate", "scale * inverse", "inverse"),
    ),
    "estimate/test_noise_memory.py": (
        ("estimate.noise_memory", "added_by_memory", "s2 * a * KX", "a * KX"),
        ("estimate.noise_memory", "added_by_memory", "s2 * (1 - a) - 1", "s2 * (1 - a)"),
    ),
    "calibration/test_matrices.py": (
        ("calibration.matrices", "corrections", "offset + m[b] / scale", "offset - m[b] / scale"),
        ("calibration.matrices", "corrections", "A = turn @ A", "A = A"),
    ),
    "checks/test_jitter.py": (
        ("checks.jitter", "_prediction_error", "np.sqrt(1 + (w**2).sum(1))", "np.sqrt(1 + w.sum(1))"),
        ("checks.jitter", "jitter_of", "np.sqrt(np.mean([a / b", "(np.mean([a / b"),
    ),
    "recording/test_increments.py": (
        ("recording.increments", "intervals", "prepend=last", "prepend=time[0]"),
    ),
    "recording/test_noise_levels.py": (
        ("inference.white_noise", "scaled_differences", "comb(order, j) ** 2 / weight", "comb(order, j) / weight"),
        ("recording.noise_levels", "header_coloured_noise", 'recording.noise.get(f"{key}_tau", TAU)', "TAU"),
    ),
    "recording/test_row_sigma.py": (
        ("recording.row_sigma", "by_sigma", "before * (typical / sigma) ** 2", "before * (typical / sigma)"),
        ("recording.row_sigma", "by_sigma", "to_si(typical, column.unit)", "typical"),
    ),
    "checks/test_table.py": (
        ("checks.input_errors", "Correction.of", "self.matrices[quantity][1].T", "self.matrices[quantity][1]"),
    ),
    "checks/test_trials.py": (
        ("checks.input_errors", "successful_trials", "trial.misfit <= sufficient", "trial.misfit < sufficient"),
        ("checks.input_errors", "successful_trials", "tolerance * least", "least"),
        ("checks.input_errors", "Correction.corrected", "self.clock * recording.time", "recording.time"),
        ("checks.input_errors", "in_other_units", "to_si(1.0, unit) / to_si(1.0, one)",
         "to_si(1.0, one) / to_si(1.0, unit)"),
    ),
    "checks/test_rates.py": (
        ("checks.rates", "earth_rate", "np.sin(latitude)", "np.cos(latitude)"),
    ),
    "recording/test_reading.py": (
        ("recording.noise_levels", "Scatter.sigma", "np.sqrt(self.squares / self.count)",
         "np.sqrt(self.squares) / self.count"),
    ),
    "recording/test_joining.py": (
        ("recording.joining", "_clock", "a.time[-1] < b.time[0]", "a.time[0] < b.time[0]"),
        ("recording.joining", "_session_weights", "(common / r.noise[sensor]) ** 2", "(r.noise[sensor] / common) ** 2"),
    ),
    "checks/test_gravity_turns.py": (
        ("checks.input_errors", "AxisPermutation.inverse", "sign * self.matrix.T", "sign * self.matrix"),
        ("rotation", "composed_rotation", "C[:, 1::2] @ C[:, : n - n % 2 : 2]", "C[:, : n - n % 2 : 2] @ C[:, 1::2]"),
        ("checks.measured_turns", "turns_of", "(level[k] + level[k + 1]) / 2", "level[k]"),
        ("checks.measured_turns", "MeasuredTurns.deviation", "2 * np.arcsin(", "np.arcsin("),
    ),
    "recording/test_gravity.py": (
        ("recording.site", "with_normal_gravity", "ANOMALY**2 + UNKNOWN_HEIGHT**2) ** 0.5",
         "ANOMALY**2 + UNKNOWN_HEIGHT**2)"),
    ),
    "recording/test_dates.py": (
        ("recording.dates", "Dates.seconds", "- sign * (3600 * east[0] + 60 * east[1])",
         "+ sign * (3600 * east[0] + 60 * east[1])"),
        ("recording.dates", "Dates._of_numbers", "/ tick)", ")"),
    ),
    "checks/test_odd_rows.py": (
        ("checks.dropouts", "Dropouts._in_file", 'side="right"', 'side="left"'),
    ),
    "importers/test_importers.py": (
        ("importers.imu_tk", "_counts_in", "float(to_si(1.0, unit))", "1.0"),
        ("checks.input_errors", "Correction.corrected", "sigma = np.abs(part) @", "sigma = np.eye(len(own)) @"),
    ),
    "importers/test_pointing.py": (
        ("importers.phd2", "import_phd2", 'DECRawDistance") - _pulsed_pixels', 'DECRawDistance") + _pulsed_pixels'),
        ("importers.phd2", "import_phd2", "drive - west / np.cos(declination)", "drive - west * np.cos(declination)"),
        ("importers.phd2", "_pulsed_pixels", "length / 1000", "length"),
        ("importers.phd2", "_pulsed_pixels", "[[0.0], moved[:-1]]", "[moved]"),
        ("importers.tpoint", "_by_stars", "15 * (lst[:, None] - stars[:, ::2])", "15 * (stars[:, ::2] - lst[:, None])"),
        ("importers.tilt_table", "import_tilt_table", "sign * arrays", "arrays"),
        ("importers.tpoint", "_joined_sexagesimal", "np.where(np.signbit(words[:, 0]), -1.0, 1.0)",
         "np.where(words[:, 0] < 0, -1.0, 1.0)"),
    ),
    "guess/test_proposal.py guess/test_layouts.py": (
        ("guess.clocks", "unwrapped_clock", "period * np.cumsum(step < 0)", "period * (step < 0)"),
        ("guess.merged_logs", "resampled_readings", "(x[1:] + x[:-1]) / 2 * np.diff(t2)", "(x[1:] + x[:-1]) / 2"),
    ),
    "guess/test_pointing_run.py": (
        ("guess.pointing_run", "pointing_proposal", "/ np.cos(true[axes[1]])", "* np.cos(true[axes[1]])"),
        ("guess.pointing_run", "_sense_of_offsets", "return -1, f", "return 1, f"),
    ),
    "guess/test_layouts.py": (
        ("guess.celestial", "axis_angles", "hours - _hours(table, name)", "_hours(table, name) - hours"),
        ("guess.celestial", "axis_angles", "else quarter - x", "else x - quarter"),
        ("guess.celestial", "axis_angles", "-x if words[name] & OFFSET", "x if words[name] & OFFSET"),
    ),
    "guess/test_gimbal_chain.py": (
        ("checks.forces", "_predicted", "-apply_matrix(platform", "apply_matrix(platform"),
    ),
    "guess/test_guesses.py": (
        ("guess.clocks", "clock_jitter", "(high - low) / 2 / middle", "(high - low) / 2"),
        ("guess.clocks", "costs_of_unit", "1 / (step * size)", "step / size"),
        ("guess.merged_logs", "on_one_clock", "from_si(other.seconds, first.guesses[first.clock].unit)",
         "other.columns[other.clock]"),
        ("guess.pointing_run", "_offset", "np.radians(x / 240)", "np.radians(x / 3600)"),
        ("guess.gimbal_chain", "unit_of_angle", "> 2 * pi", "< 2 * pi"),
        ("guess.celestial", "_hours", "x if hours else x / 15", "x if hours else x * 15"),
    ),
    "guess/test_celestial.py": (
        ("guess.celestial", "_sidereal_of_utc", "degrees + east", "degrees - east"),
        ("guess.celestial", "_sidereal_of_utc", "360.98564736629 * days", "360.0 * days"),
        ("guess.celestial", "_days", "- 0.5 + x / 86400", "+ x / 86400"),
    ),
    "navigate/test_static_run.py": (
        ("navigate.static_run", "_errors", "output.latitude - site.latitude", "site.latitude - output.latitude"),
        ("navigate.static_run", "_errors", "- site.phase - EARTH_RATE *", "- site.phase + EARTH_RATE *"),
        ("navigate.static_run", "_errors", "= -navigator_attitude_error", "= navigator_attitude_error"),
        ("navigate.static_run", "horizontal_distance", "M, N = radii", "N, M = radii"),
        ("navigate.static_run", "_navigator_input", "1 + mean_shortening", "1 - mean_shortening"),
        ("navigate.uncertainty", "_sampled_sigma", "V * np.sqrt(np.maximum(w, 0.0))", "V * np.maximum(w, 0.0)"),
        ("navigate.summary", "_position", "run.position / NAUTICAL_MILE", "run.position"),
        ("navigate.summary", "_position", "np.mean(error**2)", "np.mean(error)"),
    ),
    "navigate/test_strapdown_unit.py": (
        ("navigate.strapdown_unit", "_means", "run.time - dt / 2", "run.time + dt / 2"),
        ("navigate.strapdown_unit", "aligned_attitude", "exponential(-phi) @ C", "exponential(phi) @ C"),
    ),
    "navigate/test_stationary_base.py": (
        ("navigate.stationary_base", "still_unit", "[0.0, 0.0, -site.gravity]", "[0.0, 0.0, site.gravity]"),
        ("navigate.stationary_base", "still_unit", "C_bn.T @ rate_at", "C_bn @ rate_at"),
        ("navigate.strapdown_unit", "navigate_intervals", "2 * aids.damping", "aids.damping"),
        ("navigate.strapdown_unit", "navigate_intervals", "motion.position[:, :2] - true[:, :2]",
         "true[:, :2] - motion.position[:, :2]"),
        ("navigate.strapdown_unit", "navigate_intervals", "motion.C_bn @ motion.C_bn[0].T",
         "motion.C_bn @ motion.C_bn[0]"),
        ("navigate.strapdown_unit", "_is_at_rest", "< MAX_REST_EARTH_RATES * EARTH_RATE", "< MAX_REST_EARTH_RATES"),
        ("navigate.strapdown_unit", "navigate_intervals", "rotation_vector(motion", "-rotation_vector(motion"),
    ),
    (
        "diagnose/test_cost.py::test_a_drift_left_out_costs_what_it_drifts "
        "diagnose/test_cost.py::test_what_the_others_take_up_costs_nothing"
    ): (
        ("diagnose.cost", "_cost_of_effects", ".position.max()) / NAUTICAL_MILE for c", ".position.max()) for c"),
    ),
    "diagnose/verdict/test_joint_fit.py::test_without_a_cause_the_others_take_up_what_they_can": (
        ("diagnose.verdict.joint_fit", "JointFit.without", " if c.effect != effect_id]", "]"),
    ),
    "diagnose/verdict/test_agreement.py": (
        ("estimate.sharing", "agreement_test", "shared.dof - sum(s.dof for s in alone)", "shared.dof"),
        ("diagnose.verdict.agreement", "_constant_differences", "np.hypot(after.sigma[j], before.sigma[i])",
         "after.sigma[j]"),
        ("diagnose.verdict.agreement", "agreement_on_constants", "2 * min(shared.p_value, rarest",
         "min(shared.p_value, rarest"),
        ("words.diagnosis_sentences", "constants_disagreement", "recording {odd + 1}", "recording {odd}"),
    ),
    "diagnose/search/test_combine.py::test_order_does_not_matter_and_singles_add_up": (
        ("diagnose.search.ranking", "ranked_hypotheses", "UNKNOWN if c.rival else SINGLE",
         "SINGLE if c.rival else UNKNOWN"),
    ),
    (
        "diagnose/verdict/test_random_walk.py::test_walks_compete_with_what_was_found "
        "diagnose/verdict/test_random_walk.py::test_a_walk_twenty_times_as_likely_as_any_cause_is_told_alone "
        "diagnose/verdict/test_random_walk.py::test_a_walk_is_as_large_as_its_grid_says_on_the_axis_that_is_likeliest"
    ): (
        ("diagnose.verdict.random_walk", "RandomWalkFinding.share_of", "1 + np.exp(self.ln_odds)",
         "1 + np.exp(-self.ln_odds)"),
        ("diagnose.verdict.random_walk", "part_of_walk", "named_without and ln_odds <= CLAIM",
         "named_without and ln_odds <= -CLAIM"),
        ("diagnose.verdict.random_walk", "single_walk", "clearest.ln_total - without_walks.ln_total",
         "without_walks.ln_total - clearest.ln_total"),
        ("diagnose.verdict.random_walk", "likeliest_walk", "from_si(np.exp(mean)", "from_si(mean"),
        ("diagnose.verdict.random_walk", "likeliest_walk", "spread * walk, ln_odds", "spread, ln_odds"),
        ("diagnose.search.sensor_random_walks", "likely_wandering_noises", "s.ln_total >= CLAIM", "s.ln_total < CLAIM"),
        ("diagnose.search.sensor_random_walks", "likely_wandering_noises", "s.ln_total - CLAIM", "s.ln_total + CLAIM"),
    ),
    "diagnose/verdict/test_random_walk.py::test_a_weak_drift_is_told_with_the_walk_that_it_may_be": (
        ("diagnose.verdict.random_walk", "_in_common_noises", "logsumexp(joint, axis=0) - logsumexp(null)",
         "logsumexp(joint, axis=0)"),
    ),
    "diagnose/verdict/test_random_walk.py::test_a_clear_drift_is_no_walk": (
        ("diagnose.search.sensor_random_walks", "noise_weights", "np.log(n.prior) +", "-np.log(n.prior) +"),
    ),
    "diagnose/test_cost.py::test_a_still_base_warms_and_cools_once_a_day_through_what_was_recorded": (
        ("diagnose.cost", "_with_daily_swing", "(v.max() - v.min()) / 2 * turn", "(v.max() - v.min()) * turn"),
    ),
    "diagnose/search/test_rounds.py": (
        ("diagnose.search.relinearise", "about_first_cause", "before <= MIN_CHI2_RATIO", "before > MIN_CHI2_RATIO"),
        ("diagnose.search.stepwise", "likeliest_round", "CLAIM * several", "-CLAIM * several"),
        ("diagnose.search.stepwise", "swap_causes", "best.ln_odds_over > SWAP", "best.ln_odds_over > -SWAP"),
        ("diagnose.search.stepwise", "backward_eliminate", "kind), support[i], i)", "kind), -support[i], i)"),
        ("diagnose.search.stepwise", "needed_evidence", "CLAIM - USUAL_CAUSE_BONUS", "CLAIM + USUAL_CAUSE_BONUS"),
        ("diagnose.search.stepwise", "likeliest_selection", "share) - SWAP", "share) + SWAP"),
        ("diagnose.search.stepwise", "likeliest_selection", "share) + SWAP", "share) + 9 * SWAP"),
    ),
    "diagnose/search/test_relinearise.py::test_about_the_angles_of_each_visit_nothing_is_curved": (
        ("diagnose.search.relinearise", "_corrections_of_visits", "reshape(v, -1) * sigma", "reshape(v, -1) / sigma"),
        ("diagnose.search.relinearise", "_rows_about_corrections", "rows.residual + back", "rows.residual - back"),
    ),
    "diagnose/search/test_stepwise.py::test_the_first_step_takes_away_most": (
        ("diagnose.search.stepwise", "order_by_explanation", "np.argmin([m.scatter", "np.argmax([m.scatter"),
    ),
    (
        "diagnose/search/test_combine.py::test_what_happens_once_is_of_one_recording_and_a_shape_of_one_or_of_all_that_show_it"
    ): (
        ("diagnose.search.combine", "matched_candidates", "[k] if c.once", "[ABSENT] if c.once"),
    ),
    "diagnose/search/test_combine.py::test_a_recording_that_does_not_see_a_cause_says_what_it_does_without": (
        ("diagnose.search.ranking", "Ranking.summed", "total[~present] += otherwise[k]",
         "total[~present] -= otherwise[k]"),
    ),
    "report/test_calibration_page.py": (
        ("report.parameters", "as_printed", "zero + x / k", "zero - x / k"),
        ("report.residuals", "by_position", "/ np.sqrt(means.weight)", "/ means.weight"),
        ("report.parameters", "as_printed", 'dx / abs(k), "counts"', 'dx, "counts"'),
    ),
    "words/test_sentences.py": (
        ("words.diagnosis_headline", "_finding_clause", "sign * p.value > 0", "sign * p.value < 0"),
        ("words.diagnosis_headline", "_value_in_words", "100 * value, 100 * sigma", "100 * value, sigma"),
        ("words.diagnosis_headline", "_size_in_print", "to_si(size, unit), printed", "to_si(size, printed), unit"),
        ("words.diagnosis_headline", "_residuals_sentence", "chi2**0.5", "chi2"),
    ),
    "report/test_numbers.py": (
        ("report.history_page", "_history_row", "p.values[-1] - p.values[-2]", "p.values[-2] - p.values[-1]"),
        ("report.history_page", "_parameter_chart", "- p.drift_per_year * years", "+ p.drift_per_year * years"),
        ("report.history_page", "_parameter_chart", "2 * sigma[chosen]", "sigma[chosen]"),
        ("report.parameters", "_parameter_row", "(e.value - float(from_si(truth", "(e.value + float(from_si(truth"),
        ("report.parameters", "_parameter_row", "from_si(truth[p.label], p.unit)", "truth[p.label]"),
        ("report.residuals", "by_position", "read=measured).residual", "read=measured).residual * -1"),
        ("report.residuals", "by_position", "gravity=-s.force", "gravity=s.force"),
        ("report.parameters", "_stage_picture", "/ p.sigma", "* p.sigma"),
        ("report.chart", "limits", "m.y - m.spread, m.y + m.spread", "m.y - m.spread, m.y"),
        ("report.figures", "sky", "x, y = -r * np.sin(a)", "x, y = r * np.sin(a)"),
        ("report.figures", "tornado", "np.arange(len(names), dtype=float)[::-1]", "np.arange(len(names), dtype=float)"),
        ("report.figures", "dots_by_name", "np.arange(len(names), dtype=float)[::-1]",
         "np.arange(len(names), dtype=float)"),
        ("report.figures", "_in_view", "MAX_BAR_RATIO * float(residual.max(initial=0.0)), MAX_BAR_RATIO",
        "MAX_BAR_RATIO"),
        ("report.sections", "innovations_by_leg", '(~stop, "ring"', '(stop, "ring"'),
        ("report.noise_page", "_chart", 'np.array(c.tau_s), np.array(c.deviation)',
         'np.array(c.deviation), np.array(c.tau_s)'),
        ("report.sections", "night_by_night", "t.change or 0.0, t.change_sigma or 0.0", "t.value, t.sigma"),
        ("report.navigation_page", "budget_report", "100 * budget.share[i]", "budget.share[i]"),
        ("report.sections", "pointing_picture", "np.sqrt((x**2).sum(axis=1).mean())", "(x**2).sum(axis=1).mean()"),
    ),
    "calibration/test_gravity_uncertainty.py": (
        ("calibration.gravity_uncertainty", "scale_factor_direction", "1 + x if", "1 - x if"),
    ),
    "cli/test_noise.py": (
        ("at_rest", "Channel.result", "(2 * np.sqrt(self.model))", "np.sqrt(self.model)"),
    ),
    "simulate/test_simulate.py::test_a_temperature_walks_by_the_root_of_time": (
        ("simulate.simulation", "sample_path", "np.sqrt(KNOT_STEP_S / 3600)", "(KNOT_STEP_S / 3600)"),
    ),
}  # fmt: skip


def room_of(mistake: Mistake) -> str:
    """The room that a mistake is made in."""
    return mistake[0].split(".")[0]


ROOMS = tuple(sorted({room_of(m) for mistakes in CHOSEN.values() for m in mistakes}))


def chosen(room: str, outdated: list[str]) -> Iterator[tuple[Mutant, Tests]]:
    """The mistakes in a room, each with its tests; those that the code has no place for any more go to `outdated`."""
    for tests, mistakes in CHOSEN.items():
        for module, *mistake in (m for m in mistakes if room_of(m) == room):
            try:
                yield mistaken(f"gimbalcal.{module}", *mistake), tuple(f"tests/{t}" for t in tests.split())
            except ValueError as problem:
                outdated.append(str(problem))
