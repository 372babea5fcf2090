r"""Diagnosis of a recording with gimbal angles and gyroscopes: forces through the path, gyroscopes through the views.

    forces at known angles ──> library, search, decide ──┐
          └─ accelerometers with what was found           ├──> one diagnosis
    rates less the Earth's ──> at rest, between rests ───┘

The gimbals say how the Earth's rate lies in the unit, up to the heading psi of the base, which the rests tell:

.. math:: \omega_{ie}^p = \Omega \, C_b^p \, (\cos L \cos\psi, \; -\cos L \sin\psi, \; -\sin L)^T
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration, Residual
from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.diagnose.known_noise import diagnose_known_noise
from gimbalcal.diagnose.result import Finding, Mismatch, Shape
from gimbalcal.diagnose.rows.baseline import by_triad
from gimbalcal.diagnose.rows.rest_rates import RESTS, rest_rates
from gimbalcal.diagnose.rows.turns import FEWEST, view_of_turns
from gimbalcal.diagnose.search.refit import start
from gimbalcal.diagnose.unknown_noise import calibration_of, found_at_rest, on_the_way
from gimbalcal.diagnose.view_diagnosis import ViewDiagnosis, curves_of, diagnose_view
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.accelerometers.norm_fit import LINEAR
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import ideal_force, stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import View
from gimbalcal.words import diagnosis_sentences

NOTHING = Calibration("gimbals", (), (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))


def has_gyroscopes(recording: Recording) -> bool:
    """Whether gimbals tell the attitude and gyroscopes were logged, or should have been."""
    logged = recording.kind.in_positions and recording.has(RATE) and recording.position is not None
    return bool(recording.platform.axes) and (logged or recording.kind.rotating)


def diagnose_both_triads(
    recording: Recording, calibration: Calibration | None, baseline: Sequence[str], seed: int, tell: Tell
) -> Diagnosis:
    """What was left out of the models of both triads.

    A baseline of gyroscope effects alone asks for the gyroscopes alone, and so on. Raises InputError for a rotation
    without rests.
    """
    means = recording.kind.rotating and not recording.instant
    recording = _with_rests(recording)
    mine, gyro = by_triad(baseline)
    asked = (recording.has(FORCE) or not recording.has(RATE)) and (mine or not baseline)
    found = diagnose_known_noise(recording, calibration, mine, seed, tell) if asked else None
    told, notes = list[ViewDiagnosis](), list[str]()
    if recording.has(RATE) and not (mine and not gyro):
        made = calibration if found is None or found.calibration is None else _accelerometers(found.calibration)
        explained = found is None or found.verdict != "unexplained"
        told, notes = _gyroscopes(recording, made, gyro, explained, tell)
    late, unlooked = _slews(recording, found, told, tell, means)
    notes += unlooked
    for note in notes:
        tell(note)
    if found is None or told or late or recording.has(RATE):
        return _together(recording, found, [*told, *late], notes, baseline, seed)
    said = {"notes": list(notes)} if notes else {}
    return replace(found, in_words=" ".join([found.in_words, *notes]), provenance={**found.provenance, **said})


def _slews(
    recording: Recording, found: Diagnosis | None, told: Sequence[ViewDiagnosis], tell: Tell, means: bool
) -> tuple[list[ViewDiagnosis], list[str]]:
    """What the slews say, with accelerometers and mount as the rests tell them, and gyroscopes as the turns do."""
    made = found.calibration if found is not None and found.calibration is not None else NOTHING
    gyro = next((t.model.effects for t in told if t.view.name == "turns"), ())
    both = recording.has(RATE) and recording.has(FORCE)
    return on_the_way(without_earth(recording) if both else recording, made, gyro, tell, means)


def _with_rests(recording: Recording) -> Recording:
    """Rests at known angles are positions, whatever turned between them."""
    if recording.kind.in_positions:
        return recording
    if recording.position is None or not np.any(recording.position > 0):
        raise InputError(
            f"{recording.title!r} is a rotation recording without rests: `diagnose` compares rests and the turns "
            "between them, so give a `position` column that numbers the rests and is 0 on the way"
        )
    return replace(recording, kind=MULTI_POSITION)


def _accelerometers(made: Calibration) -> Calibration:
    """The accelerometers of a calibration of the forces, without the mount."""
    kept = tuple(e for e in made.effects if e.stage in SENSOR_STAGES and e.channel == FORCE)
    at = [i for i, p in enumerate(made.parameters) if p.effect in {e.id for e in kept}]
    wanted = tuple(made.parameters[i] for i in at)
    return replace(made, effects=kept, parameters=wanted, covariance=made.covariance[np.ix_(at, at)])


def _gyroscopes(
    recording: Recording, made: Calibration | None, gyro: Sequence[str], explained: bool, tell: Tell
) -> tuple[list[ViewDiagnosis], list[str]]:
    """What the views of the gyroscopes say, and what cannot be said of them, in sentences."""
    rests = len(dwell_means(recording).time)
    if rests < RESTS:
        return [], [diagnosis_sentences.gyroscopes_not_analysed(f"that takes {RESTS} dwells, not {rests}")]
    if not recording.has(FORCE):
        force = ideal_force(recording, recording.angles())
        recording = replace(
            recording, channels={**recording.channels, **{(FORCE, a): force[:, i] for i, a in enumerate("xyz")}}
        )
        made = NOTHING
    made = made or multiposition(recording, LINEAR)
    turning = view_of_turns(without_earth(recording), made) if explained and not gyro else None
    linear = start(turning).effects if turning else ()
    still = rest_rates(without_earth(recording, linear), gyro, made)
    if still is None:
        return [], [diagnosis_sentences.gyroscopes_not_analysed(diagnosis_sentences.COUNTS_WITHOUT_SCALE)]
    notes = []
    if turning is None and not gyro:
        why = f"fewer than {FEWEST} turns between rests were logged" if explained else "nothing explains the forces"
        notes = [diagnosis_sentences.rate_not_analysed(why)]

    def looked(v: View) -> ViewDiagnosis:
        tell(f"the gyroscopes: {diagnosis_sentences.channels_of(v)}")
        return diagnose_view(v, tell)

    told = [looked(replace(still, missed_by_turns=None))]
    if turning and (found := found_at_rest(told[0])):
        turning = view_of_turns(without_earth(recording), made, found)
    return [*told, *([looked(turning)] if turning else [])], notes


def without_earth(recording: Recording, gyro: Sequence[Effect] = ()) -> Recording:
    """Rates less what the gyroscopes, with these effects, read of the Earth's rate; counts stay as they are."""
    L = recording.site.latitude
    if L is None or recording.counted(RATE):
        return recording
    rest = dwell_means(recording)
    A = EARTH_RATE * attitude_of(rest)
    u = rest.triad(FORCE) / rest.site.gravity
    level = np.concatenate([np.einsum("ij,n->nij", np.eye(3), np.ones(len(u))), np.einsum("ij,nk->nijk", np.eye(3), u)
                            .reshape(len(u), 3, 9)], axis=-1)  # fmt: skip
    columns = np.concatenate([np.cos(L) * A[..., :2], EARTH_RATE * level], axis=-1).reshape(3 * len(u), -1)
    north = np.linalg.lstsq(columns, rest.triad(RATE).ravel(), rcond=1e-9)[0][:2]
    size = float(np.hypot(*north))
    north = north / size if size > 0 else np.array([1.0, 0.0])
    earth = EARTH_RATE * attitude_of(recording) @ np.array([*(np.cos(L) * north), -np.sin(L)])
    seen = gyroscopes(earth, stimulus_from_readings(recording), gyro)
    rate = recording.triad(RATE) - seen
    channels = {**recording.channels, **{(RATE, a): rate[:, i] for i, a in enumerate("xyz")}}
    # at the equator the vertical has no part of the Earth's rate: nothing is left there to take off once more
    return replace(recording, channels=channels, site=replace(recording.site, latitude=0.0))


def attitude_of(recording: Recording) -> Array:
    """C_bp (n, 3, 3) as the gimbals tell it."""
    return recording.platform.attitude(recording.angles())


@dataclass(frozen=True)
class _Part:
    """What one view says: name, verdict, fit, and a sentence of what naming the causes does or what is left."""

    name: str
    said: Diagnosis | ViewDiagnosis
    in_words: str

    @property
    def rank(self) -> tuple[int, float]:
        """Verdict, then how far it is off."""
        off = 0.0 if self.said.verdict == "adequate" else self.said.fit.chi2_reduced_before
        return VERDICTS.index(self.said.verdict), off


def _part_of_forces(d: Diagnosis) -> _Part:
    if d.findings:
        return _Part("forces", d, diagnosis_sentences.chi2_reduction(d.fit, "Reduced chi^2 of the forces"))
    left = f"Reduced chi^2 of the forces is {d.fit.chi2_reduced_before:.3g}."
    return _Part("forces", d, left if d.verdict == "adequate" else "")


def _together(
    recording: Recording, forces: Diagnosis | None, told: Sequence[ViewDiagnosis], notes: Sequence[str],
    baseline: Sequence[str], seed: int,
) -> Diagnosis:  # fmt: skip
    parts = [] if forces is None else [_part_of_forces(forces)]
    parts += [
        _Part(t.view.name, t, diagnosis_sentences.view_in_words(t.view, t.fit, t.findings, t.verdict)) for t in told
    ]
    if not parts:
        raise InputError(f"{recording.title!r} leaves nothing to compare. {' '.join(notes)}")
    lead = max(parts, key=lambda p: p.rank)
    parts_by_weight = [lead, *(p for p in parts if p is not lead)]
    mismatch = tuple(m for p in parts_by_weight for m in p.said.mismatch)
    found = tuple(f for p in parts for f in p.said.findings)
    shapes = tuple(u for p in parts for u in p.said.unexplained)
    ids = [i for t in told for i in t.view.baseline]
    options = {"seed": seed} if forces is None else dict(forces.provenance["options"])
    provenance: dict[str, Any] = {
        "version": gimbalcal.__version__,
        "recordings": recording.files,
        **({} if forces is None else forces.provenance),
        "options": {**options, "baseline": list(baseline) or [*_ids(options), *ids]},
        "views": [p.name for p in parts],
        **({"notes": list(notes)} if notes else {}),
    }
    fitted = replace(lead.said.fit, views={p.name: p.said.fit for p in parts})
    verdict = lead.said.verdict
    also = joined([o for p in parts if (o := p.said.outcome)])
    words = _answer(verdict, parts, found, shapes, mismatch, [f"{also}."] * bool(also) + list(notes))
    drawn = curves_of(lead.said) if isinstance(lead.said, ViewDiagnosis) else lead.said.curves
    held = None if forces is None else forces.calibration
    made = calibration_of(recording, told, diagnosis_sentences.reservation(verdict, found, shapes), held)
    recommend = next(filter(None, (p.said.recommend for p in parts_by_weight)), "")
    return Diagnosis(verdict, mismatch, found, shapes, fitted, provenance, words, drawn, made, outcome=also,
                     laws=tuple(law for p in parts for law in p.said.laws), recommend=recommend)  # fmt: skip


def _ids(options: Mapping[str, Any]) -> list[str]:
    return list(options.get("baseline", []))


def _answer(
    verdict: str, parts: Sequence[_Part], found: Sequence[Finding], shapes: Sequence[Shape],
    mismatch: Sequence[Mismatch], notes: Sequence[str],
) -> str:  # fmt: skip
    """One answer that names what both triads lack."""
    if verdict == "adequate":
        out = ["The calibrated model explains these data."]
    elif found:
        out = [f"{diagnosis_sentences.causes(verdict, found)}."]
    else:
        out = [diagnosis_sentences.NO_CAUSE]
    out += [p.in_words for p in parts if p.in_words]
    out += [f"The remaining misfit has no known cause: {diagnosis_sentences.shape_in_words(u)}." for u in shapes[:1]]
    out += [f"{m.in_words}." for m in mismatch[:1]]
    return " ".join(filter(None, [*out, diagnosis_sentences.delays(found), *notes]))
