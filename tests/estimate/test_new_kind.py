"""A new kind of measurement is one view and one kind: an inclinometer beside the accelerometers of a unit."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal import methods
from gimbalcal.design.manoeuvres import available_manoeuvres
from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.joint_diagnosis import calibrated_views
from gimbalcal.effects import CATALOGUE, parameters, values, with_values
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.estimate.fit import fit
from gimbalcal.forward import accelerometers, linearise
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site, dwell_means
from gimbalcal.recording import kinds as recording_kinds
from gimbalcal.recording.kinds import Kind
from gimbalcal.recording.record import FORCE
from gimbalcal.views.core import Fit, Measurement, View, nuisance, recording_fields
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.norm import norm
from gimbalcal.words.calibration_sentences import scaled_to_residual

G, SIGMA, ANGLE = 9.8, 2e-4, 2e-6  # m/s^2, of a mean; rad, of the inclinometer
AXES = tuple(("covariate", f"inclination_{a}") for a in "xy")
UP = ("covariate", "upside_down")
INCLINATION = Measurement("inclination", "mg", "positions", "the force", "the force along {axis}", (FORCE,))


def inclined(recording, baseline=()):
    """Return the view of accelerometers whose force an inclinometer tells, in the axes of its case."""
    means = dwell_means(recording)
    tilt = np.stack([np.sin(means.channels[key]) for key in AXES], axis=-1)
    third = np.sqrt(1 - (tilt**2).sum(axis=1)) * np.where(means.channels[UP] > 0.5, -1.0, 1.0)
    force = means.site.gravity * np.column_stack([tilt, third])
    s = stimulus_from_readings(means).at(force=force)
    channels = tuple((FORCE, a) for a in "xyz")

    def rows(effects):
        return linearise(BENCH, s, effects, channels=channels, read=means.triad(FORCE), stages=SENSOR_STAGES)

    return View(
        INCLINATION, channels=channels, **recording_fields(means), stimulus=s, label=s.position,
        evaluate=rows, stages=SENSOR_STAGES, baseline=tuple(baseline) or ACCELEROMETER_TERMS,
        groups=np.arange(len(force)), noise=NoiseModel(),
    )  # fmt: skip


def replace_view(kind, view):
    fields = {f.name: getattr(kind, f.name) for f in dataclasses.fields(kind)}
    return Kind(**{**fields, "view": view})


def _beside_an_inclinometer(platform, channels):
    return not platform.axes and AXES[0] in channels


INCLINED = Kind(
    "multi-position", methods=("least-squares",), baseline=ACCELEROMETER_TERMS, predicted=(FORCE,), in_positions=True,
    when=_beside_an_inclinometer, view=f"{__name__}:inclined",
)  # fmt: skip

WANTED = tuple(p for i in ACCELEROMETER_TERMS for p in parameters(CATALOGUE[i]))
TRUE = np.array([2e-4, -1e-4, 3e-4, 4e-3, -2e-3, 1e-3, 1e-4, -2e-4, 5e-5, 3e-4, -1e-4, 2e-4])


@pytest.fixture(autouse=True)
def known(monkeypatch):
    monkeypatch.setattr(recording_kinds, "EVERY", [INCLINED, *recording_kinds.EVERY])


def recorded(rng, more=(), zero=0.0):
    """Forty attitudes, each held for five rows, with an inclinometer that is right but for its noise and a zero."""
    v = rng.standard_normal((40, 3))
    u = np.repeat(v / np.linalg.norm(v, axis=1, keepdims=True), 5, axis=0)
    true = (*with_values((), WANTED[: len(TRUE)], TRUE), *more)
    n = len(u)
    force = {(FORCE, a): G * u[:, i] for i, a in enumerate("xyz")}
    number, site = np.repeat(np.arange(1, 41), 5), Site(0.6, 0.0, G)
    blank = Recording("multi-position", "inclined", BENCH, site, {}, np.arange(float(n)), number, force)
    y = accelerometers(G * u, stimulus_from_readings(blank), true) + SIGMA * np.sqrt(5) * rng.standard_normal((n, 3))
    read = np.arcsin(u[:, :2]) + zero + ANGLE * rng.standard_normal((n, 2))
    tilts = {key: read[:, i] for i, key in enumerate(AXES)}
    return replace(
        blank, channels={**{(FORCE, a): y[:, i] for i, a in enumerate("xyz")}, **tilts, UP: 1.0 * (u[:, 2] < 0)}
    )


def test_a_recording_with_its_channels_is_of_the_new_kind():
    r = recorded(np.random.default_rng(0))
    assert r.kind is INCLINED
    assert (
        replace(r, channels={k: x for k, x in r.channels.items() if k[0] == FORCE}).kind is recording_kinds.HAND_TURNED
    )
    assert methods.usual_method([r]) == "least-squares"


def test_it_is_calibrated():
    found, _ = methods.calibrate([recorded(np.random.default_rng(1))])
    error = (found.values - values(with_values((), WANTED, TRUE), found.parameters)) / found.sigmas
    assert len(error) == len(WANTED) == len(TRUE)
    assert np.abs(error).max() < 4
    assert 0.5 < np.sqrt(np.mean(error**2)) < 1.6
    assert found.residual.rms["specific_force:x"] == pytest.approx(SIGMA, rel=0.3)
    assert found.outcome == ""


def test_what_is_added_and_what_it_lacks_are_found():
    (cubic,) = with_values((), parameters(CATALOGUE["cubic_nonlinearity"])[1:2], np.array([4e-5]))
    r = recorded(np.random.default_rng(2), [cubic])
    d = diagnose([r])
    assert d.verdict == "missing-physics"
    assert d.findings[0].effect == "cubic_nonlinearity"
    found, _ = methods.calibrate([r], more=["cubic_nonlinearity:y"])
    at = [p.effect for p in found.parameters].index("cubic_nonlinearity")
    assert abs(found.values[at] - 4e-5) < 4 * found.sigmas[at]
    assert diagnose([recorded(np.random.default_rng(3))]).verdict == "adequate"


def of_known_scale(recording, baseline=()):
    """Return the view in a noise that the data sheet states, each row by itself."""
    bare = inclined(recording, baseline)
    return replace(bare, noise=NoiseModel(np.full(3, SIGMA), scale_known=True, block=np.arange(len(bare))))


def test_its_noise_may_be_of_a_known_scale(monkeypatch):
    known_scale = replace_view(INCLINED, f"{__name__}:of_known_scale")
    monkeypatch.setattr(recording_kinds, "EVERY", [known_scale, *recording_kinds.EVERY])
    clean = recorded(np.random.default_rng(2))
    found, _ = methods.calibrate([clean])
    assert found.residual.chi2 == pytest.approx(108, rel=0.3)
    assert not scaled_to_residual(found)
    assert diagnose([clean]).verdict == "adequate"
    (cubic,) = with_values((), parameters(CATALOGUE["cubic_nonlinearity"])[1:2], np.array([4e-5]))
    d = diagnose([recorded(np.random.default_rng(2), [cubic])])
    assert (d.verdict, d.findings[0].effect, d.findings[0].axis) == ("missing-physics", "cubic_nonlinearity", "y")


def without_blocks(recording, baseline=()):
    """Return the view in a noise that the data sheet states, of rows that follow one another evenly."""
    return replace(inclined(recording, baseline), noise=NoiseModel(np.full(3, SIGMA), scale_known=True))


def test_a_noise_of_known_scale_needs_no_blocks(monkeypatch):
    by_spectrum = replace_view(INCLINED, f"{__name__}:without_blocks")
    monkeypatch.setattr(recording_kinds, "EVERY", [by_spectrum, *recording_kinds.EVERY])
    assert diagnose([recorded(np.random.default_rng(2))]).verdict == "adequate"
    (warming,) = with_values((), [p for p in parameters(CATALOGUE["warm_up"]) if p.axis == "y"], np.array([5e-3]))
    d = diagnose([recorded(np.random.default_rng(2), [replace(warming, tau=30.0)])])
    assert (d.verdict, d.findings[0].axis, d.fit.heldout_by) == ("missing-physics", "y", "time")


def test_no_manoeuvre_is_planned_where_only_its_view_knows_the_attitude():
    assert available_manoeuvres(recorded(np.random.default_rng(0))) == ()


def with_zeros(recording, baseline=()):
    """Return the view with the zeros of the inclinometer as nuisances."""
    bare = inclined(recording, baseline)
    turned = bare.stimulus.force / np.linalg.norm(bare.stimulus.force, axis=1, keepdims=True)
    N = np.zeros((len(bare), 3, 2))
    for k in range(2):  # force along z follows from the two others
        N[:, k, k], N[:, 2, k] = G * np.sqrt(1 - turned[:, k] ** 2), 0.0
        N[:, 2, k] = -turned[:, k] * N[:, k, k] / turned[:, 2]
    zeros = tuple(nuisance("zero", a, "rad", 1e-3) for a in "xy")
    return replace(bare, nuisances=zeros, evaluate=lambda effects: replace(bare.evaluate(effects), nuisance=-N))


def test_its_nuisances_are_free_in_a_diagnosis_as_in_a_calibration(monkeypatch):
    of_zeros = replace_view(INCLINED, f"{__name__}:with_zeros")
    monkeypatch.setattr(recording_kinds, "EVERY", [of_zeros, *recording_kinds.EVERY])
    r = recorded(np.random.default_rng(5), zero=np.array([4e-4, -2e-4]))
    found, _ = methods.calibrate([r])
    assert found.provenance.noise.from_ == "residual"  # nothing was stated, and chi^2 tests nothing
    assert diagnose([r]).verdict == "adequate"


def test_views_that_share_parameters_are_calibrated_in_one_frame():
    # the norm has no reference for a rotation of the triad and states three misalignments, the other view states six
    errors = []
    for seed in range(6):
        r = recorded(np.random.default_rng(10 + seed))
        alone, angles = norm(r), inclined(r)
        tied_down = tuple(p for i in ACCELEROMETER_TERMS for p in alone.parameters_of(i))
        each = [(v, fit([v], wanted)) for v, wanted in ((alone, tied_down), (angles, WANTED))]
        seen = [Fit(v, m.effects, m.parameters, m.residual[0], m.residual[0][..., None], m.covariance) for v, m in each]
        made = calibrated_views([alone, angles], seen, (), "")
        true = with_values((), WANTED, TRUE)
        assert {p.label for p in made.parameters} == {p.label for p in WANTED}
        errors.append((made.values - values(true, made.parameters)) / made.sigmas)
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.35
    assert np.abs(errors).max() < 4.5
