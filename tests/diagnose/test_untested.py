"""Positions in no more attitudes than the model has constants test nothing, and nothing says that they do."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.importers.pointing_files import pointing_run
from gimbalcal.platform import KNOWN
from gimbalcal.recording.record import FORCE, UNKNOWN_SITE
from gimbalcal.views.norm import attitudes, determined_terms, undetermined_misalignments
from gimbalcal.words.diagnosis_headline import headline
from tests.estimate.accelerometers.test_multiposition import TRUTH, rested, scattered
from tests.golden import golden_text

FACES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]]) / np.sqrt(2)


def near(directions, deg, seed=0):
    """Return unit vectors within some degrees of directions (m, 3)."""
    u = directions + np.radians(deg) / 2 * np.random.default_rng(seed).standard_normal(directions.shape)
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


def test_attitudes_are_counted_and_not_dwells():
    assert attitudes(near(np.tile(FACES, (5, 1)), 0.5)) == 6
    assert attitudes(near(np.repeat([[0.0, 0, 9.8]], 40, axis=0), 0.5)) == 1


def test_six_faces_determine_six_terms_and_faces_with_edges_nine():
    faces = near(np.tile(FACES, (3, 1)), 1.0)
    assert undetermined_misalignments(faces) == ("xy", "xz", "yz")
    assert determined_terms(faces) == ("bias", "scale_factor")
    both = near(np.concatenate([FACES, EDGES]), 1.0)
    assert undetermined_misalignments(both) == ()
    assert determined_terms(both) == ("bias", "scale_factor", "misalignment")
    assert undetermined_misalignments(near(np.concatenate([FACES, EDGES[:4], FACES]), 1.0)) == ("yz",)
    assert determined_terms(scattered(9)) == ("bias", "scale_factor")  # nothing would test nine


def test_six_faces_are_calibrated_as_six_faces_and_say_what_is_missing():
    made = multiposition(rested(TRUTH, near(np.tile(FACES, (2, 1)), 1.0)))
    assert {p.effect for p in made.parameters} == {"bias", "scale_factor"}
    golden_text((made.provenance.options.declined or {})["misalignment"])


def test_one_attitude_calibrates_nothing():
    with pytest.raises(InputError, match="in 1 attitude "):
        multiposition(rested(TRUTH, near(np.repeat(FACES[:1], 12, axis=0), 0.5)))
    with pytest.raises(InputError, match="in 1 attitude "):
        multiposition(rested(TRUTH, near(np.repeat(FACES[:1], 12, axis=0), 0.5)), ("bias", "scale_factor"))


@pytest.mark.parametrize("count", [1, 6])
def test_no_model_is_adequate_that_nothing_tests(count):
    unit = rested(TRUTH, near(np.tile(FACES[:count], (12 // count, 1)), 0.5))
    found = diagnose([replace(unit, noise={})], baseline=("bias",) if count == 1 else ())
    assert found.verdict == "adequate"
    assert found.outcome
    assert "can be used" not in headline(found)
    golden_text(headline(found))


def test_a_word_of_stated_noise_needs_a_header_that_states_it():
    unit = rested(TRUTH, scattered(14))
    shaken = unit.triad(FORCE) * (1 + 3e-3 * np.random.default_rng(1).standard_normal((len(unit.time), 1)))
    for noise in ({}, {"accelerometer": 1e-4}):
        loud = replace(
            unit, noise=noise, scatter={(FORCE, a): 1e-4 for a in "xyz"},
            channels={**unit.channels, **{(FORCE, a): shaken[:, i] for i, a in enumerate("xyz")}},
        )  # fmt: skip
        found = diagnose([loud])
        words = f"{headline(found)} {found.in_words}"
        assert found.verdict != "adequate" or found.outcome
        if not noise:
            assert "stated noise" not in words
            assert "as stated" not in words


def sighted(path, elevation, noise, seed=5):
    """A run of stars [rad] in any order, whose readouts scatter by `noise` [rad] on the sky."""
    rng, n = np.random.default_rng(seed), len(elevation)
    true = {"azimuth": rng.uniform(0, 2 * np.pi, n), "elevation": rng.permutation(elevation)}
    off = {"azimuth": rng.normal(0, noise, n) / np.cos(true["elevation"]), "elevation": rng.normal(0, noise, n)}
    path.touch()
    read = {axis: x + off[axis] for axis, x in true.items()}
    return pointing_run(path, KNOWN["alt-az"], UNKNOWN_SITE, 60.0 * np.arange(n), read, true)


HIGH = np.radians(np.r_[10.0, np.linspace(70, 75, 7)])


@pytest.mark.parametrize(("elevation", "noise_deg"), [(HIGH, 0.03), (np.radians(np.linspace(15, 75, 60)), 5.0)])
def test_a_mount_is_not_tested_by_one_low_star_nor_where_no_effect_would_show(tmp_path, elevation, noise_deg):
    found = diagnose([sighted(tmp_path / "a", elevation, np.radians(noise_deg))])
    assert found.verdict == "adequate"
    golden_text(headline(found))
    assert found.outcome
    assert found.in_words.startswith("The calibrated model is not contradicted by these data.")


def test_elevations_on_a_common_step_show_no_worm_of_as_many_teeth(tmp_path):
    """Of white noise; the readouts of 60 elevations on 59 steps of 60 deg coincide at 354 teeth, but for that noise."""
    found = diagnose([sighted(tmp_path / "a", np.radians(np.linspace(15, 75, 60)), np.radians(0.03))])
    assert (found.verdict, found.findings, found.outcome) == ("adequate", (), "")
