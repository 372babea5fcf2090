"""Gimbals that are set to a degree: what they take of the force along itself is told, and hides nothing."""

from dataclasses import replace

import numpy as np

from gimbalcal.diagnose import diagnose
from gimbalcal.diagnose.evidence.stated_noise import nominal_noise, scale_to_scatter, setting_is_second_order
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.search.relinearise import about_settings
from gimbalcal.estimate.grade import grade_of_unit
from gimbalcal.views.known_attitude import view_at_known_attitude
from tests.diagnose.grade_plant import PATTERNS, of_force, on_gimbals

DEGREE = 3600.0


def observed(setting):
    """A clean unit in 18 positions of a table that sets its angles to so many arcsec."""
    r = on_gimbals(3, "tactical", setting=setting)
    return scale_to_scatter(fit_baseline(view_at_known_attitude(grade_of_unit([r], "").of([r])[0])))


def misfit(o):
    """What the calibration leaves in the nominal noise, per row."""
    node = nominal_noise(o)
    Z, y = (node.whiten(o.reduced(x)) for x in (o.Z, o.residual[:, :, None]))
    left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-9)[0]
    return float((left**2).sum()) / (len(y) - Z.shape[1])


def test_about_the_angles_of_each_visit_nothing_is_curved():
    loose = observed(DEGREE)
    about = about_settings(loose)
    assert about.view.local.remaining < 0.01
    again = about.view.evaluate(about.effects).over(about.sigma)  # what is read there is what the rows hold
    np.testing.assert_allclose(again.residual, about.residual, atol=1e-6)
    assert 0.8 < misfit(about) < 1.3
    spread = replace(loose.view.local, remaining=about.view.local.remaining)
    same_noise = replace(loose, view=replace(loose.view, noise=about.view.noise, local=spread))
    assert misfit(same_noise) > 20  # about the angles that were read


def test_settings_of_arcseconds_are_left_alone():
    tight = observed(1.0)
    assert not setting_is_second_order(tight)
    assert about_settings(tight) is tight


def test_a_step_of_300_ug_shows_although_the_settings_take_as_much():
    def law(r):
        return PATTERNS["bias_step"](r, 1)

    d = diagnose([on_gimbals(4, "tactical", of_force(1, law), 300.0, setting=DEGREE)])
    (found,) = d.findings
    assert (found["effect"], found["axis"]) == ("bias_step", "y")
    step = next(p for p in found["parameters"] if p["name"] == "bias_step")
    assert abs(step["value"] - 300.0) < 3 * step["sigma"]
