"""The first sentences of a calibration: did it work, how much is left, what is not known, what next."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan, sqrt
from typing import Any, Literal

from gimbalcal.report.wording import counted, label_in_words, leading, listed, sentence, typeset, unobservable_of
from gimbalcal.units import from_si

Verdict = Literal["fits", "misfit", "overstated", "reserved"]
SURPRISE = 1e-3  # probability below which chance is not believed
WANDERING = 1.5  # times the noise of a mean; less is no news
NEGLIGIBLE = 0.1  # relative excess over the stated noise that no user would act on, however significant


def fit(chi2: float, dof: int) -> tuple[float, float, Verdict]:
    """Residual in units of the noise, probability of a chi^2 at least as large, and what that means."""
    from scipy.special import chdtrc

    if dof <= 0:
        return float("nan"), float("nan"), "fits"
    ratio = sqrt(chi2 / dof)
    p = float(chdtrc(dof, chi2))
    if p < SURPRISE and ratio > 1 + NEGLIGIBLE:
        return ratio, p, "misfit"
    if p > 1 - SURPRISE and ratio < 1 - NEGLIGIBLE:
        return ratio, p, "overstated"
    return ratio, p, "fits"


def scaled_to_residual(content: Mapping[str, Any]) -> bool:
    """Whether the noise was estimated from the residual itself, so that chi^2 says nothing about the fit."""
    provenance = content["provenance"]
    noise = provenance.get("noise", {})
    sources = (noise.get("accelerometer_from"), noise.get("gimbal_angle_from"))
    return "residual" in sources or bool(provenance.get("options", {}).get("excess_scatter"))


def noise_is_stated(content: Mapping[str, Any]) -> bool:
    """Whether recording.toml told the noise; else it was taken from how the samples scatter."""
    noise = content["provenance"].get("noise", {})
    return "samples" not in (noise.get("accelerometer_from"), noise.get("from"))


def verdict(content: Mapping[str, Any]) -> Verdict:
    """What the fit says of the model, from the content of calibration.json."""
    if content["outcome"]:
        return "reserved"
    if content["provenance"].get("pattern"):
        return "misfit"  # what is left is no noise, whatever its size
    return fit(content["residual"]["chi2"], content["residual"]["dof"])[2]


def answer(content: Mapping[str, Any]) -> str:
    """A few plain sentences from the content of calibration.json: did it work, what is not known, what next."""
    if content["outcome"]:
        return typeset(sentence(content["outcome"]) + _limits(content))
    told = f"{_left(content)}."
    asked = _limits(content)
    return typeset(f"{told[0].upper()}{told[1:]}{_far_off(content)}{asked} {_known(content)}{_next(content)}")


def _limits(content: Mapping[str, Any]) -> str:
    """What noise and hands did not allow, a sentence each."""
    return "".join(f" {sentence(text)}" for text in content["provenance"].get("limits", []))


def _next(content: Mapping[str, Any]) -> str:
    """What a person does with a calibration that fits; one that does not says so where it says why."""
    doubted = content["provenance"].get("pattern")
    if doubted or verdict(content) != "fits" or content["residual"]["dof"] <= 0:
        return ""
    every, tied = len(content["parameters"]), len(_tied(content))
    if 0 < every < 2 * tied:
        both = " and calibrate them together with this" if tied < every else ""
        return f" Next: record more attitudes{both}; `gimbalcal observe` says beforehand which see what."
    return " Next: `gimbalcal apply` corrects recordings with it."


def _tied(content: Mapping[str, Any]) -> list[str]:
    """Labels of the parameters that the data do not tell alone."""
    return list(dict.fromkeys(label for u in unobservable_of(content) for label in leading(u["direction"])))


def _known(content: Mapping[str, Any]) -> str:
    """How many of the parameters are known, and which of them only together."""
    every, unobservable = content["parameters"], unobservable_of(content)
    if not unobservable:
        return f"All {counted(len(every), 'parameter')} are known."
    tied = _tied(content)
    names = listed([*map(label_in_words, tied[:4]), *([f"{len(tied) - 4} more"] if len(tied) > 4 else [])])
    apart = " from each other" if len(tied) > 1 else ""
    known = f"{len(every) - len(tied)} of {len(every)} parameters are known"
    return f"{known}; these data cannot tell {names}{apart}: the report says why."


def _left(content: Mapping[str, Any]) -> str:
    """What is left of the readings, how large it is, and what that means."""
    ratio, _, meaning = fit(content["residual"]["chi2"], content["residual"]["dof"])
    if isnan(ratio):
        return "there are as many unknowns as data, so nothing is left to test the fit with: more positions would"
    if scaled_to_residual(content) and meaning == "fits":
        return _scaled(content)
    stated = noise_is_stated(content)
    noise = f"{ratio:.2f} times the {'stated noise' if stated else 'noise that the samples show'}"
    if meaning == "fits":
        return f"the calibration explains these data: what is left is {noise}"
    if meaning == "overstated":
        smaller = f"the noise is smaller than {'stated' if stated else 'that'}, and so is every sigma"
        return f"what is left is {noise}: {smaller}; state it in [noise]"
    other = "is larger than stated" if stated else "wanders more than it scatters from sample to sample"
    return (
        f"what is left is {noise}, more than chance allows: the model lacks something, or the noise {other}; "
        "`gimbalcal diagnose` tells which"
    )


def _scaled(content: Mapping[str, Any]) -> str:
    """What is left where nobody stated the noise and it says nothing of the fit."""
    rms = content["residual"].get("rms", {})
    star, force = (
        sqrt(sum(x**2 for c, x in rms.items() if c.startswith(key))) for key in ("pointing", "specific_force")
    )
    if star:
        left = float(f"{from_si(star, 'arcsec'):.3g}")
        told = f"{left:g} arcsec rms of a star on the sky is left, and every sigma is scaled to that"
        return f"{told}{_pattern(content['provenance'].get('pattern', {}))}"
    size = ""
    if force:
        ug = float(from_si(force / sqrt(sum(c.startswith("specific_force") for c in rms)), "ug"))
        size = f" by {ug / 1e3:.3g} mg" if ug >= 1e3 else f" by {ug:.3g} ug"
    return f"the readings scatter{size} about the calibration, and every sigma is scaled to that{_wandering(content)}"


def _wandering(content: Mapping[str, Any]) -> str:
    """How far the scatter of the positions is above the noise of their means, where that is known and worth saying."""
    times = content["provenance"].get("options", {}).get("excess_over_noise") or 0.0
    if times < WANDERING:
        return ""
    return f", {times:.2g} times what the noise of the samples explains: the outputs wander from position to position"


def _pattern(pattern: Mapping[str, Any]) -> str:
    """What is left of stars that is no noise, in words; empty for none."""
    if not pattern:
        return ""
    where = f"what is left {pattern['channel']} follows the {pattern['axis'].replace('_', ' ')}"
    return f"; but it is no noise: {where}, and `gimbalcal diagnose` looks for the cause"


def _far_off(content: Mapping[str, Any]) -> str:
    """A sentence on stars far off the others; empty for none."""
    stars = content["provenance"].get("far_off", [])
    if not stars:
        return ""
    worst = ", ".join(f"number {s['star']} of “{s['title']}” by {s['arcsec']:.3g} arcsec" for s in stars[:3])
    one = len(stars) == 1
    which = "A star is" if one else f"{counted(len(stars), 'star').capitalize()} are"
    why = stars[0].get("why", "mistaken or not centred")
    away = f"leave {'it' if one else 'them'} out"
    act = away if why.startswith("mistaken") else "`gimbalcal diagnose` looks for the cause"
    return f" {which} far off the others, {worst}: {why}; {act}."
