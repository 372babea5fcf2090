"""The page of a calibration, built from its result and the recordings behind it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration
from gimbalcal.effects import Effect
from gimbalcal.effects.effect import stated_law
from gimbalcal.errors import number_of
from gimbalcal.number import Array
from gimbalcal.recording import SENSORS, Recording
from gimbalcal.recording.dwell import visited_positions
from gimbalcal.references import cite
from gimbalcal.report import sections
from gimbalcal.report.figures import correlation
from gimbalcal.report.formulas import formula
from gimbalcal.report.html import Context, picture, render
from gimbalcal.report.parameters import nominal_in_words, rows, stages
from gimbalcal.report.terms import term_tables
from gimbalcal.units import from_si, is_raw
from gimbalcal.words import calibration_sentences, naming
from gimbalcal.words.rounding import p_value, printed_number, significant

MIN_CORRELATION = 0.3  # of a pair in the table


def calibration_report(
    c: Calibration, recordings: Sequence[Recording] = (), truth: Mapping[str, float] | None = None
) -> str:
    """Return the page of a calibration and the recordings behind it.

    truth: SI values by label, of a simulated recording; it adds each parameter's error in sigmas.
    """
    leading, others = sections.pictures(c, recordings)
    null_directions = c.null_directions
    context = {
        "title": "; ".join(r.title for r in recordings) or "no recording available",
        "date": (c.provenance.created or "")[:16].replace("T", " "),
        "answer": calibration_sentences.calibration_in_words(c),
        "verdict": calibration_sentences.calibration_verdict(c),
        "facts": _facts(c, recordings),
        "rows": rows(c, truth),
        "with_truth": truth is not None,
        "nominal": nominal_in_words(c.readout),
        "unobservable": naming.directions_in_words(null_directions),
        "held": naming.directions_in_words(u for u in c.unobservable if u not in null_directions),
        "lost": c.provenance.lost or "",
        **term_tables(c),
        **sections.night_by_night(c),
        "checks": calibration_sentences.navigation_checks(c),
        "leading": leading,
        "pictures": others,
        "recordings": [_measured(r) for r in recordings],
        **stages(c, truth),
        "matrices": _matrices(c),
        **_correlations(c),
        **_model(c),
        **_provenance(c, recordings),
    }
    return render("calibration.html", context)


def _facts(c: Calibration, recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    """Return the numbers of the first screen."""
    total, residual = len(c.parameters), c.residual
    ratio, p, _ = calibration_sentences.goodness_of_fit(residual.chi2, residual.dof)
    facts = [(f"{total - len(c.null_directions)} of {total}", "combinations of parameters determined")]
    if calibration_sentences.scaled_to_residual(c) and (ug := calibration_sentences.force_rms(c)):
        facts.append((f"{significant(ug, 3)} µg", "rms residual of the specific force"))
    if sky := calibration_sentences.sky_rms(c):
        facts.append((f"{significant(sky, 3)} arcsec", "rms residual of a star on the sky"))
    if residual.dof > 0 and not calibration_sentences.scaled_to_residual(c):
        freedom = f"χ² {residual.chi2:.{0 if residual.chi2 > 100 else 1}f} with {residual.dof} degrees of freedom"
        facts.append((f"{ratio:.2f} × noise", f"residual; p-value {p_value(p)} ({freedom})"))
    facts += sections.navigation_facts(c)
    rows = sum(int(r.weight.sum()) for r in recordings)
    if rows:
        facts.append((f"{rows:,}".replace(",", " "), "samples used"))
    return facts


def _matrices(c: Calibration) -> list[Context]:
    """Return T, K and b of each triad as formulas, with the units of reading and result."""
    out = []
    for triad, m in c.matrices.items():
        unit = "m/s²" if triad == "accelerometers" else "rad/s"
        counts = getattr(c.readout, triad) is not None
        parts = [
            (r"T = ", m.T, "{:.6f}"),
            (r"\text{diag} K = ", m.K[:, None], "{:.7g}" if counts else "{:.6f}"),
            ("b = ", m.b[:, None], "{:.7g}" if counts else "{:.5g}"),
        ]
        latex = r", \quad ".join(name + _matrix(M, digits) for name, M, digits in parts)
        units = f"K in {unit} per count, b in counts" if counts else f"K without unit, b in {unit}"
        out.append({"name": triad, "equation": formula(latex) or latex, "units": units})
    return out


def _matrix(M: Array, digits: str) -> str:
    """Return a matrix as LaTeX, its numbers in this format."""
    each = [[re.sub(r"e([-+])0*(\d+)", r" \\cdot 10^{\1\2}", digits.format(x)) for x in row] for row in M]
    rows = r" \\ ".join(map(" & ".join, each))
    return rf"\begin{{bmatrix}} {rows} \end{{bmatrix}}"


def _correlations(c: Calibration) -> Context:
    """Return a picture of the correlation matrix and its strongest pairs."""
    if len(c.parameters) < 2:
        return {"correlation": None, "strongest": []}
    labels = [naming.label_in_words(p.label) for p in c.parameters]
    sigma = c.sigmas
    R = c.covariance / np.where(sigma > 0, sigma, 1.0) / np.where(sigma > 0, sigma, 1.0)[:, None]
    upper = [(i, j) for i in range(len(labels)) for j in range(i + 1, len(labels)) if abs(R[i, j]) >= MIN_CORRELATION]
    ranked = sorted(upper, key=lambda ij: -abs(R[ij]))[:12]
    strongest = [
        {"words": f"{labels[i]} with {labels[j]}", "value": printed_number(f"{R[i, j]:+.2f}")} for i, j in ranked
    ]
    strongest = strongest or [{"words": f"none exceeds {MIN_CORRELATION}", "value": ""}]
    pair = f"{strongest[0]['words']} {strongest[0]['value']}".strip()
    drawn = picture([correlation(labels, R)], f"Correlation matrix of {len(labels)} parameters; strongest: {pair}.")
    return {"correlation": drawn, "strongest": strongest}


def _model(c: Calibration) -> Context:
    """Return the effects whose parameters were estimated, from their own cards, and the literature they cite."""
    cards = {i: c.effect_class(i) for i in dict.fromkeys(p.effect for p in c.parameters)}
    keys = list(dict.fromkeys(key for card in cards.values() for key in card.sources))
    numbers = {key: n for n, key in enumerate(keys, 1)}
    effects = []
    for i, card in cards.items():
        axes = [naming.without_underscores(p.axis) for p in c.parameters if p.effect == i]
        effects.append(
            {
                "words": naming.without_underscores(i),
                "sentence": (card.__doc__ or "").strip().split("\n\n")[0].replace("\n", " "),
                "equation": formula(law) or law if (law := _law(card)) else "",
                "parameters": ", ".join(filter(None, axes)) or "one",
                "sources": ", ".join(f"[{numbers[key]}]" for key in card.sources),
            }
        )
    return {"effects": effects, "citations": cite(*keys)}


def _law(effect: type[Effect]) -> str:
    """Return the equation that defines the parameters of an effect, with T0 where it has one."""
    card = stated_law(effect)
    if "T0_degC" not in card:
        return str(card["equation"])
    return rf"{card['equation']}, \qquad T_0 = {card['T0_degC']:g}\,\text{{°C}}"


def _measured(r: Recording) -> Context:
    """Return a description of a recording, as pairs of term and text."""
    site = r.site
    where = [f"gravity {site.gravity:.6f} m/s²", f"height {site.height:.0f} m"]
    if site.latitude is not None:
        where.insert(0, f"latitude {np.rad2deg(site.latitude):.4f}°")
    positions = visited_positions(r)
    visits = f", {naming.number_and_noun(positions, 'position')}" if positions else ""
    duration = float(r.time[-1] - r.time[0])
    facts = [
        ("kind", r.kind + visits),
        ("platform", f"{r.platform.name} ({', '.join(r.platform.axis_names) or 'no gimbals'})"),
        ("duration", f"{duration / 3600:.2f} h" if duration > 3600 else f"{duration:.0f} s"),
        ("rows", f"{len(r.time)}, from {number_of(int(r.weight.sum()), 'sample')}"),
        ("site", "; ".join(where)),
        ("noise, one sigma", _noise(r) or "neither stated nor estimated"),
    ]
    return {"title": r.title, "facts": facts + [("remark", naming.typeset(text)) for text in r.remarks]}


def _noise(r: Recording) -> str:
    """Return the noise of one sample of each sensor, in the unit it was logged in where its size is not known."""
    parts = []
    printed = {"accelerometer": "ug", "gyroscope": "deg/h", "gimbal_angle": "arcsec", "attitude": "arcsec"}
    for sensor, unit in printed.items():
        sigma = r.sigma(sensor)
        if sigma is None:
            continue
        logged = {u for (quantity, _), u in r.units.items() if quantity == SENSORS[sensor] and is_raw(u)}
        value, word = (sigma, logged.pop()) if logged else (float(from_si(sigma, unit)), unit)
        parts.append(f"{sensor.replace('_', ' ')} {significant(value, 3)} {naming.unit_in_print(word)}")
    return "; ".join(parts)


NOISE_SOURCES = {"header": "stated in recording.toml", "samples": "from the scatter of the samples",
                 "residual": "from the residual"}  # fmt: skip


def _noise_in_words(noise: AssumedNoise) -> str:
    """Return the noise of each sensor that the calibration assumed, and its source."""
    parts = []
    for sensor, sigma, unit, source in (
        ("accelerometer", noise.accelerometer_ug, "ug", noise.accelerometer_from),
        ("gimbal angle", noise.known_setting_arcsec, "arcsec", noise.gimbal_angle_from),
    ):
        if source:
            size = "" if sigma is None else f" {significant(sigma, 3)} {naming.unit_in_print(unit)}"
            parts.append(f"{sensor}{size}, {NOISE_SOURCES.get(source, source)}")
    return "; ".join(parts) or naming.as_text(noise.to_dict())


SHOWN_ELSEWHERE = {"recordings", "effects", "lost", "noise", "tpoint", "population_sd_arcsec", "term_tests"}
"""Keys of the provenance that have a section of their own."""


def _provenance(c: Calibration, recordings: Sequence[Recording]) -> Context:
    """Return pairs of term and text; the page folds long ones."""
    origin = c.provenance.to_dict()
    given = {k: v for k, v in origin.items() if k not in SHOWN_ELSEWHERE}
    sources = naming.files_behind(origin, [file for r in recordings for file in r.files])
    pairs = [("method", c.method)]
    if noise := c.provenance.noise:
        pairs.append(("noise", _noise_in_words(noise)))
    pairs += [
        (str(key).replace("_", " "), naming.typeset(text))
        for key, value in given.items()
        if (text := naming.as_text(value))
    ]
    return {"provenance": pairs, "sources": sources}
