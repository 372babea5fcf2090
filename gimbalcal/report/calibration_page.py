"""The report of a calibration, built from the content of calibration.json and the recordings behind it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, from_dict
from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.effects.card import stated_law
from gimbalcal.errors import amount
from gimbalcal.recording import SENSORS, Recording
from gimbalcal.references import cite
from gimbalcal.report import answer, wording
from gimbalcal.report.chart import sensible_time
from gimbalcal.report.html import Picture, formula, picture, render
from gimbalcal.report.navigation import navigation_checks, navigation_facts, navigation_pictures
from gimbalcal.report.parameter_rows import nominal_in_words, rows
from gimbalcal.report.pointing import named_terms, night_by_night, pointing_picture
from gimbalcal.report.rate_table import rate_table_picture
from gimbalcal.report.rounding import minus, significant
from gimbalcal.report.stages import stages
from gimbalcal.report.wording import label_of
from gimbalcal.units import from_si, is_raw

STRONG = 0.3  # correlation worth a line in the table of pairs


def calibration_report(
    content: Mapping[str, Any], recordings: Sequence[Recording] = (), truth: Mapping[str, float] | None = None
) -> str:
    """The page for the content of a calibration.json and the recordings behind it.

    `truth`, label to SI value, adds each parameter's error in sigmas (a simulated recording has one).
    """
    leading, others = _evidence(content, recordings)
    context = {
        "title": "; ".join(r.title for r in recordings) or "no recording at hand",
        "date": _minute(content["provenance"]),
        "answer": answer.answer(content),
        "verdict": answer.verdict(content),
        "facts": _facts(content, recordings),
        "rows": rows(content, truth),
        "with_truth": truth is not None,
        "nominal": nominal_in_words(content),
        **_unobservable(content),
        "tpoint": named_terms(content),
        **night_by_night(content),
        "checks": navigation_checks(content),
        "leading": leading,
        "pictures": others,
        "recordings": [_measured(r) for r in recordings],
        **stages(content, truth),
        **_correlations(content),
        **_model(content),
        **_provenance(content, recordings),
    }
    return render("calibration.html", context)


def _facts(content: Mapping[str, Any], recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    """The four numbers of the first screen."""
    total, unobservable = len(content["parameters"]), len(wording.unobservable_of(content))
    residual = content["residual"]
    ratio, p, _ = answer.fit(residual["chi2"], residual["dof"])
    facts = [(f"{total - unobservable} of {total}", "combinations of parameters seen")]
    force = [rms for channel, rms in residual["rms"].items() if channel.startswith("specific_force")]
    if force and answer.scaled_to_residual(content):
        rms = float(from_si(np.sqrt(np.mean(np.square(force))), "ug"))
        facts.append((f"{significant(rms, 3)} µg", "rms left in the specific force"))
    star = [rms for channel, rms in residual["rms"].items() if channel.startswith("pointing")]
    if star:
        sky = float(from_si(np.sqrt(np.sum(np.square(star))), "arcsec"))
        facts.append((f"{significant(sky, 3)} arcsec", "rms left of a star on the sky"))
    if residual["dof"] > 0 and not answer.scaled_to_residual(content):
        freedom = (
            f"χ² {residual['chi2']:.{0 if residual['chi2'] > 100 else 1}f} with {residual['dof']} degrees of freedom"
        )
        facts.append((f"{ratio:.2f} × noise", f"is left; as much by chance: {_chance(p)} ({freedom})"))
    facts += navigation_facts(content)
    rows = sum(int(r.weight.sum()) for r in recordings)
    if rows:
        facts.append((f"{rows:,}".replace(",", " "), "samples used"))
    return facts


def _chance(p: float) -> str:
    if p > 0.99:
        return "more than 99 %"
    return f"{100 * p:.2g} %" if p >= 1e-4 else "less than 0.01 %"


def _minute(provenance: Mapping[str, Any]) -> str:
    """When the calibration was made, to the minute."""
    return str(provenance.get("created", ""))[:16].replace("T", " ")


def _unobservable(content: Mapping[str, Any]) -> dict[str, Any]:
    """What the data do not see among the unknowns, what was held instead of estimated, what missing data cost."""
    unobservable = wording.unobservable_of(content)
    told = [
        {"direction": wording.direction_in_words(u["direction"]), "why": wording.why_in_words(u)}
        for u in content["unobservable"]
    ]
    seen_as = [u in unobservable for u in content["unobservable"]]
    return {
        "unobservable": [u for u, missing in zip(told, seen_as, strict=True) if missing],
        "held": [u for u, missing in zip(told, seen_as, strict=True) if not missing],
        "lost": content["provenance"].get("lost", ""),
    }


def _evidence(content: Mapping[str, Any], recordings: Iterable[Recording]) -> tuple[list[Picture], list[Picture]]:
    """Pictures of the residuals (for the first screen) and of the data behind them."""
    leading, others = [], []
    recordings = tuple(recordings)
    if recordings and all(r.kind == "pointing" for r in recordings):
        made = from_dict(content, recordings[0].platform.axis_names)
        return [pointing_picture(recordings, made.effects)], []
    if recordings and content["method"] == "rate-table":
        return [rate_table_picture(recordings, from_dict(content, recordings[0].platform.axis_names))], []
    for r in recordings:
        made = from_dict(content, r.platform.axis_names)
        if r.kind != "static-run" and r.position is not None and r.has("specific_force"):
            first, more = _position_pictures(r, made)
            leading.append(first)
            others += more
        elif r.kind == "static-run":
            others += _run_pictures(r, made.effects)
    others += navigation_pictures(content)
    if not leading:
        leading, others = others[:1], others[1:]
    return leading, others


def _position_pictures(r: Recording, made: Calibration) -> tuple[Picture, list[Picture]]:
    from gimbalcal.report import figures
    from gimbalcal.report.evidence import by_position

    e = by_position(r, made.effects, made.provenance, made.readout)
    unit = wording.unit_in_print(e.unit)
    before, after = (significant(float(np.sqrt(np.mean(v**2))), 3) for v in (e.before, e.after))
    far = 0 if e.sigma is None else int(np.sum(np.abs(e.after) > figures.OUTLIER * e.sigma))
    circled = f"; circled: {wording.counted(far, 'reading')} beyond {figures.OUTLIER} σ" if far else ""
    residuals = picture(
        figures.residuals_by_position(e.labels, e.before, e.after, e.sigma, e.axes, unit),
        f"Residuals of {wording.counted(len(e.labels), 'position')} by axis: {before} {unit} rms before, "
        f"{after} {unit} rms after.",
        f"Measured minus model at each position of “{r.title}”: before, against perfect sensors, and after, with the "
        f"calibration (each with its own scale{circled}).",
    )
    if not r.platform.axes:
        return residuals, []
    held = picture(
        figures.schedule(e.labels, e.angles, e.axis_names, e.gravity),
        f"Gimbal angles at {wording.counted(len(e.labels), 'position')} and where gravity lay in platform axes.",
        "What the platform did: gimbal angles by position, and the direction of gravity in platform axes, along z.",
    )
    return residuals, [held]


def _run_pictures(r: Recording, effects: Sequence[Effect]) -> list[Picture]:
    """What the model leaves of a static run, and the model through the data."""
    from gimbalcal.report import figures
    from gimbalcal.report.evidence import over_time

    hours, curves = over_time(r, effects)
    time, unit = sensible_time(3600 * hours)
    left = ", ".join(f"{c.name} {significant(float(np.std(c.measured - c.fitted)), 2)} {c.unit}" for c in curves)
    charts = figures.over_time(time, curves, unit)
    return [
        picture(
            charts[1::2],
            f"Static run of {hours[-1] - hours[0]:.1f} h, what the calibrated model leaves of it: {left}.",
            f"“{r.title}”, measured minus model. The band is one σ of the noise, averaged as the points are.",
        ),
        picture(
            charts[::2],
            f"Static run of {hours[-1] - hours[0]:.1f} h with the calibrated model through it.",
            f"“{r.title}”: the harmonics of the Earth's rotation in attitude and force, less what perfect sensors "
            "would read, and the calibrated model through them.",
        ),
    ]


def _correlations(content: Mapping[str, Any]) -> dict[str, Any]:
    """Picture of the correlation matrix and its strongest pairs."""
    if len(content["parameters"]) < 2:
        return {"correlation": None, "strongest": []}
    from gimbalcal.report import parameter_figures

    words = [wording.label_in_words(label_of(p)) for p in content["parameters"]]
    P = np.array(content["covariance"], dtype=float)
    sigma = np.sqrt(np.diag(P))
    R = P / np.where(sigma > 0, sigma, 1.0) / np.where(sigma > 0, sigma, 1.0)[:, None]
    upper = [(i, j) for i in range(len(words)) for j in range(i + 1, len(words)) if abs(R[i, j]) >= STRONG]
    ranked = sorted(upper, key=lambda ij: -abs(R[ij]))[:12]
    strongest = [{"words": f"{words[i]} with {words[j]}", "value": minus(f"{R[i, j]:+.2f}")} for i, j in ranked]
    strongest = strongest or [{"words": f"none exceeds {STRONG}", "value": ""}]
    told = f"{strongest[0]['words']} {strongest[0]['value']}".strip()
    drawn = picture(
        [parameter_figures.correlation(words, R)], f"Correlation matrix of {len(words)} parameters; strongest: {told}."
    )
    return {"correlation": drawn, "strongest": strongest}


def _model(content: Mapping[str, Any]) -> dict[str, Any]:
    """The effects whose parameters were estimated, from their own cards, and the literature they cite."""
    ids = list(dict.fromkeys(p["effect"] for p in content["parameters"]))
    keys = list(dict.fromkeys(key for i in ids for key in CATALOGUE[i].sources))
    numbers = {key: n for n, key in enumerate(keys, 1)}
    effects = []
    for i in ids:
        axes = [p["axis"].replace("_", " ") for p in content["parameters"] if p["effect"] == i]
        effects.append(
            {
                "words": i.replace("_", " "),
                "sentence": (CATALOGUE[i].__doc__ or "").strip().split("\n\n")[0].replace("\n", " "),
                "equation": formula(law) or law if (law := _law(i)) else "",
                "parameters": ", ".join(filter(None, axes)) or "one",
                "sources": ", ".join(f"[{numbers[key]}]" for key in CATALOGUE[i].sources),
            }
        )
    return {"effects": effects, "citations": cite(*keys)}


def _law(effect: str) -> str:
    """The equation that the numbers of an effect mean, with T0 where it has one."""
    told = stated_law(CATALOGUE[effect])
    if "T0_degC" not in told:
        return str(told["equation"])
    return rf"{told['equation']}, \qquad T_0 = {told['T0_degC']:g}\,\text{{°C}}"


def _measured(r: Recording) -> dict[str, Any]:
    """What a recording is, as pairs of term and text."""
    site = r.site
    where = [f"gravity {site.gravity:.6f} m/s²", f"height {site.height:.0f} m"]
    if site.latitude is not None:
        where.insert(0, f"latitude {np.rad2deg(site.latitude):.4f}°")
    held = 0 if r.position is None else len(np.unique(r.position[r.position > 0]))
    visits = f", {wording.counted(held, 'position')}" if held else ""
    duration = float(r.time[-1] - r.time[0])
    facts = [
        ("kind", r.kind + visits),
        ("platform", f"{r.platform.name} ({', '.join(r.platform.axis_names) or 'no gimbals'})"),
        ("duration", f"{duration / 3600:.2f} h" if duration > 3600 else f"{duration:.0f} s"),
        ("rows", f"{len(r.time)}, from {amount(int(r.weight.sum()), 'sample')}"),
        ("site", "; ".join(where)),
        ("noise, one sigma", _noise(r) or "not stated and not seen"),
    ]
    return {"title": r.title, "facts": facts + [("remark", wording.typeset(text)) for text in r.remarks]}


def _noise(r: Recording) -> str:
    """Noise of one sample of each sensor, in the unit it was logged in where its size is not known."""
    told = []
    printed = {"accelerometer": "ug", "gyroscope": "deg/h", "gimbal_angle": "arcsec", "attitude": "arcsec"}
    for sensor, unit in printed.items():
        sigma = r.sigma(sensor)
        if sigma is None:
            continue
        logged = {u for (quantity, _), u in r.units.items() if quantity == SENSORS[sensor] and is_raw(u)}
        value, word = (sigma, logged.pop()) if logged else (float(from_si(sigma, unit)), unit)
        told.append(f"{sensor.replace('_', ' ')} {significant(value, 3)} {wording.unit_in_print(word)}")
    return "; ".join(told)


SAID = {"header": "as recording.toml states", "samples": "as the samples scatter", "residual": "as the residual tells"}


def _noise_in_words(noise: Mapping[str, Any]) -> str:
    """With what noise of each sensor it was calibrated, and where that comes from."""
    told = []
    for sensor in (key.removesuffix("_from") for key in noise if key.endswith("_from")):
        sizes = (
            f" {significant(float(noise[key]), 3)} {wording.unit_in_print(unit)}"
            for unit in ("ug", "arcsec") if noise.get(key := f"{sensor}_{unit}") is not None
        )  # fmt: skip
        said = str(noise[f"{sensor}_from"])
        told.append(f"{sensor.replace('_', ' ')}{next(sizes, '')}, {SAID.get(said, said)}")
    return "; ".join(told) or wording.as_text(noise)


def _provenance(content: Mapping[str, Any], recordings: Sequence[Recording]) -> dict[str, Any]:
    """Pairs of term and text; long ones fold."""
    given = {k: v for k, v in content["provenance"].items() if k not in ("recordings", "effects", "lost")}
    sources = wording.files(content["provenance"], [file for r in recordings for file in r.files])
    pairs = [("method", content["method"])]
    if noise := _noise_in_words(given.pop("noise", {})):
        pairs.append(("noise", noise))
    pairs += [
        (str(key).replace("_", " "), wording.typeset(text))
        for key, value in given.items()
        if (text := wording.as_text(value))
    ]
    return {"provenance": pairs, "sources": sources}
