"""Generate the sentences on a calibration: the fit, the parameters that are not determined, and what to do next."""

from __future__ import annotations

from math import isnan, sqrt
from typing import TYPE_CHECKING, Literal

from gimbalcal.p_value import probability
from gimbalcal.units import from_si
from gimbalcal.words.naming import (
    capitalised,
    label_in_words,
    leading_labels,
    list_in_words,
    number_and_noun,
    sentence,
    typeset,
    without_underscores,
)
from gimbalcal.words.rounding import printed_number, significant

if TYPE_CHECKING:
    from gimbalcal.calibration import Calibration
    from gimbalcal.calibration.provenance import TermTest

Fit = Literal["fits", "misfit", "overstated", "reserved"]
MIN_P_VALUE = 1e-3  # below it an excess is not attributed to chance
MAX_RELATIVE_EXCESS = 0.1  # of residuals over the noise or errors over sigma; less changes no decision
MAX_NAMED = 4  # parameters that are not determined, of which a sentence gives the names
MIN_EXCESS_SCATTER = 1.5  # of positions over the noise of their means, from which on it is reported


def goodness_of_fit(chi2: float, dof: int) -> tuple[float, float, Fit]:
    """Return the residual in units of the noise, the probability of a chi^2 at least as large, and the judgement."""
    if dof <= 0:
        return float("nan"), float("nan"), "fits"
    ratio = sqrt(chi2 / dof)
    p = probability(chi2, dof)
    if p < MIN_P_VALUE and ratio > 1 + MAX_RELATIVE_EXCESS:
        return ratio, p, "misfit"
    if p > 1 - MIN_P_VALUE and ratio < 1 - MAX_RELATIVE_EXCESS:
        return ratio, p, "overstated"
    return ratio, p, "fits"


def scaled_to_residual(c: Calibration) -> bool:
    """Return whether the noise was estimated from the residual itself, so that chi^2 does not test the fit."""
    noise, options = c.provenance.noise, c.provenance.options
    sources = (noise.accelerometer_from, noise.gimbal_angle_from, noise.from_) if noise else ()
    return "residual" in sources or bool(options.excess_scatter)


def noise_is_stated(c: Calibration) -> bool:
    """Return whether recording.toml states the noise; otherwise it was estimated from the scatter of the samples."""
    noise = c.provenance.noise
    return noise is None or "samples" not in (noise.accelerometer_from, noise.from_)


def calibration_verdict(c: Calibration) -> Fit:
    """Return what the residuals say of the model."""
    if c.outcome:
        return "reserved"
    if c.provenance.pattern:
        return "misfit"  # systematic residuals are no noise, whatever their size
    return goodness_of_fit(c.residual.chi2, c.residual.dof)[2]


def calibration_in_words(c: Calibration) -> str:
    """Return a few sentences on a calibration: the fit, the parameters that are not determined, and what to do next."""
    limits = "".join(f" {sentence(text)}" for text in c.provenance.limits or ())
    if c.outcome:
        return typeset(sentence(c.outcome) + limits)
    residual = f"{capitalised(_residual_against_noise(c))}.{_outliers_sentence(c)}"
    return typeset(f"{residual}{limits} {_determined_sentence(c)}{_next_of_calibration(c)}")


def _next_of_calibration(c: Calibration) -> str:
    """Return what to do with a calibration that fits; one that does not fit names the step with the reason."""
    if calibration_verdict(c) != "fits" or c.residual.dof <= 0:
        return ""
    total, confounded = len(c.parameters), len(_confounded_labels(c))
    if 0 < total < 2 * confounded:
        both = " and calibrate them jointly with this recording" if confounded < total else ""
        return f" Next: record more attitudes{both}; `gimbalcal observe` predicts what each determines."
    return " Next: `gimbalcal apply` corrects recordings with it."


def _confounded_labels(c: Calibration) -> list[str]:
    """Return the labels of the parameters that the data do not determine one by one."""
    return list(dict.fromkeys(label for u in c.null_directions for label in leading_labels(u.direction)))


def _determined_sentence(c: Calibration) -> str:
    parameters, confounded = c.parameters, _confounded_labels(c)
    if not c.null_directions:
        return f"All {number_and_noun(len(parameters), 'parameter')} are determined."
    names = list_in_words([*map(label_in_words, confounded)], MAX_NAMED)
    separately = " separately" if len(confounded) > 1 else ""
    determined = f"{len(parameters) - len(confounded)} of {len(parameters)} parameters are determined"
    return f"{determined}; these data do not determine {names}{separately} (the report gives the reason)."


def _residual_against_noise(c: Calibration) -> str:
    """Return how large the residual is, and what that says of the model and of the noise."""
    ratio, _, judgement = goodness_of_fit(c.residual.chi2, c.residual.dof)
    if isnan(ratio):
        return "there are as many unknowns as data, so the fit cannot be tested: record more positions"
    if scaled_to_residual(c) and judgement == "fits":
        return _residual_as_noise(c)
    stated = noise_is_stated(c)
    size = f"{ratio:.2f} times the {'stated noise' if stated else 'noise of the samples'}"
    if judgement == "fits":
        return f"the calibration explains these data: the residuals are {size}"
    if judgement == "overstated":
        smaller = f"smaller than {'stated' if stated else 'the samples suggest'}; state it in [noise]"
        return f"the residuals are {size}: the noise, and with it every sigma, is {smaller}"
    or_noise = f"or the noise {'is larger than stated' if stated else 'is correlated from sample to sample'}"
    incomplete = f"the model is incomplete, {or_noise}; `gimbalcal diagnose` decides which"
    return f"the residuals are {size}, more than chance allows: {incomplete}"


def sky_rms(c: Calibration) -> float:
    """Return the root mean square of the residual of a star on the sky [arcsec]; zero for any other calibration."""
    if c.provenance.stars is None:
        return 0.0
    return float(from_si(sqrt(sum(x**2 for x in c.residual.rms.values())), "arcsec"))


def force_rms(c: Calibration) -> float:
    """Return the root mean square of the residuals of the channels of the specific force [ug]; zero without any."""
    square = [x**2 for channel, x in c.residual.rms.items() if channel.partition(":")[0] == "specific_force"]
    return float(from_si(sqrt(sum(square) / len(square)), "ug")) if square else 0.0


def candidate_terms(c: Calibration) -> list[TermTest]:
    """Return the significant terms of a mount outside the model, the number of them considered, the best first."""
    outside = [t for t in c.provenance.term_tests or () if not t.in_model]
    return [t for t in outside if t.p_value * len(outside) < MIN_P_VALUE]


def _residual_as_noise(c: Calibration) -> str:
    """Return how large the residual is where its scatter is the only estimate of the noise."""
    if star := sky_rms(c):
        size = float(f"{star:.3g}")
        text = f"the residuals of the stars are {size:g} arcsec rms on the sky, and every sigma is scaled to them"
        if pattern := c.provenance.pattern:
            follows = f"the residual {pattern.channel} follows the {without_underscores(pattern.axis)}"
            text += f"; but they are not noise: {follows}, and `gimbalcal diagnose` looks for the cause"
        for best in candidate_terms(c)[:1]:
            reduced = f"{significant(best.rms_with_arcsec, 3)} arcsec (`--with {best.tpoint or best.term}`)"
            text += f". Of the terms outside the model, {label_in_words(best.term)} reduces this most, to {reduced}"
        return text
    size_of_force = ""
    if ug := force_rms(c):
        size_of_force = f" by {ug / 1e3:.3g} mg" if ug >= 1e3 else f" by {ug:.3g} ug"
    excess = c.provenance.options.excess_over_noise or 0.0
    beyond = "times what the noise of the samples explains: the outputs change from position to position"
    wandering = f", {excess:.2g} {beyond}" if excess >= MIN_EXCESS_SCATTER else ""
    return f"the readings scatter{size_of_force} about the calibration, and every sigma is scaled to that{wandering}"


def _outliers_sentence(c: Calibration) -> str:
    """Return a sentence on stars far from all others; empty for none."""
    stars = c.provenance.far_off or ()
    if not stars:
        return ""
    worst = ", ".join(f"number {s.star} of “{s.title}” by {s.arcsec:.3g} arcsec" for s in stars[:3])
    one = len(stars) == 1
    which = "One star is an outlier" if one else f"{capitalised(number_and_noun(len(stars), 'star'))} are outliers"
    why = stars[0].why
    omit = f"leave {'it' if one else 'them'} out"
    step = omit if why.startswith("mistaken") else "`gimbalcal diagnose` looks for the cause"
    return f" {which}, {worst}: {why}; {step}."


# --- a navigator in place ---------------------------------------------------------------------------------------------

CHECK_SIGMAS = 3.0  # beyond, a check fails
MAX_NEES = 5.0  # of a mean of few independent squares
MAX_REJECTED = 0.01  # share of updates that disturbances of the base explain


def navigation_checks(c: Calibration) -> list[dict[str, str]]:
    """Return the consistency checks of the filter: NIS, NEES, rejected updates and whiteness, each with a sentence.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 5.4.
    """
    n = c.residual.navigation
    if not n:
        return []
    nis, nees, white = n["nis"], n["nees"]["position"], n["whiteness"]
    spread, lag = sqrt(2 / nis["dof"]), white["lag_one"] / white["sigma"]
    if abs(nis["ratio"] - 1) <= CHECK_SIGMAS * spread:
        of_nis = "this is 1 within its scatter."
    elif nis["ratio"] > 1:
        of_nis = "this is more: the noise is larger than stated, or the model is incomplete."
    else:
        of_nis = "this is less: sensors or base are quieter than stated, so the sigmas are conservative."
    of_updates = "there are none." if not n["rejected"] else (
        "disturbances of the base explain so few." if n["rejected"] <= MAX_REJECTED * n["updates"] else
        "so many mean that the model is wrong or that the base moves.")  # fmt: skip
    of_lag = "this is 0 within its scatter." if abs(lag) < CHECK_SIGMAS else (
        f"this is {abs(lag):.2g} sigmas from it: a slow error of the velocity is not in the model." if lag > 0 else
        f"this is {abs(lag):.2g} sigmas from it: they alternate, as for a base quieter than stated.")  # fmt: skip
    checks = [
        ("NIS", f"{nis['ratio']:.3f} ± {spread:.3f}",
         f"Normalised innovation squared of the velocity updates, mean; 1 is expected, and {of_nis}"),
        ("NEES", significant(nees, 2),
         "Normalised estimation error squared of the position, which never changed, mean; a random walk has few "
         "independent values in a run, so up to 5 is usual, and this is "
         + ("usual." if nees <= MAX_NEES else "more: the drift exceeds its sigma.")),
        ("rejected updates", f"{n['rejected']} of {n['updates']}",
         f"Velocity updates that were rejected as outliers; {of_updates}"),
        ("whiteness", f"{white['lag_one']:.3f} ± {white['sigma']:.3f}",
         f"Correlation of successive innovations; 0 is expected, and {of_lag}"),
    ]  # fmt: skip
    return [{"name": name, "number": printed_number(number), "sentence": text} for name, number, text in checks]
