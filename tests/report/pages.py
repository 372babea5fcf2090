"""A page of every kind, with names that nobody broke into lines."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from gimbalcal import from_arrays
from gimbalcal.at_rest import rest_noise
from gimbalcal.campaign.campaign_folder import CampaignSummary
from gimbalcal.design.budget import budget
from gimbalcal.design.optimal import design
from gimbalcal.design.position_observability import observe, observe_any
from gimbalcal.design.rig_positions import rig_of
from gimbalcal.design.turning_design import GroupSigma, TurnsDesign
from gimbalcal.design.turning_observability import observe_turning
from gimbalcal.diagnose.answer import Curves, Diagnosis
from gimbalcal.diagnose.result import Estimate, Finding, FitSummary, LawResult, Mismatch, Shape
from gimbalcal.earth import G0
from gimbalcal.entries import entry_from
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.guess.log import Guess
from gimbalcal.guess.proposal import Proposal
from gimbalcal.history.compare import PrintedComparison
from gimbalcal.navigate.navigation_errors import Navigated
from gimbalcal.navigate.space_stable_navigator import Aids
from gimbalcal.navigate.summary import NavigationInputs, summary
from gimbalcal.recording import Recording
from gimbalcal.report.calibration_page import calibration_report
from gimbalcal.report.campaign_page import campaign_report
from gimbalcal.report.diagnosis_page import diagnosis_report
from gimbalcal.report.history_page import history_report
from gimbalcal.report.navigation_page import budget_report, navigation_report
from gimbalcal.report.new_page import proposal_page
from gimbalcal.report.noise_page import noise_report
from gimbalcal.report.plan_page import design_report, observability_report, plan_report
from gimbalcal.schedule.published import ROTATIONS
from tests.estimate.pointing.mounts import ALT_AZ, effects, run, sky
from tests.report.example import example

LONG = "Bench_4-of-the-laboratory_with-a-title-that-nobody-broke_" * 4

HISTORY = entry_from(PrintedComparison, {
    "unit": LONG, "in_words": "bias y jumped by 3 mg.", "agree": False,
    "common_gravity_sigma_ppm": 0.0, "due": "2027-01-01",
    "calibrations": [{"date": f"2026-0{k}-01T00:00:00+00:00", "name": LONG, "method": "three-stage", "outcome": ""}
                     for k in (1, 2, 3)],
    "steps": [{"before": k, "after": k + 1, "chi2": 3.0, "dof": 2, "p_value": 0.2, "same_recording": False}
              for k in (0, 1)],
    "parameters": [{"name": n, "axis": "y", "effect": n, "unit": "ug", "calibrations": [0, 1, 2],
                    "values": [1.0, 2.0, 300.0], "sigmas": [1.0, 1.0, 1.0], "jumps": [2], "outliers": [],
                    "due": "2027-01-01", "scatter": 0.0, "drift_per_year": 3.0, "drift_sigma": 1.0}
                   for n in ("bias", "scale_factor")],
}, "compare.json")  # fmt: skip

TURNS = TurnsDesign(
    ROTATIONS["wei2022-30"], 3870.0,
    tuple(GroupSigma(g, u, s, {"wei2022-30": 2 * s}, 0.5)
          for g, s, u in (("bias", 0.144, "ug"), ("gyro_bias", 0.0025, "deg/h"))),
    ("wei2022-30",),
)  # fmt: skip

CUBIC = Finding("cubic_nonlinearity", "y", 0.78, 24.1, (Estimate("K3", "y", 16.2, 0.7, "ug/g^3"),))
MISMATCH = Mismatch("specific_force", "y", {"positions": (4, 10)}, 41.2, 1e-7, "y differs where it carries 1 g")
FIT = FitSummary(chi2_reduced_before=3.1, chi2_reduced_after=1.02, heldout_before=3.3, heldout_after=1.05, noise={})
DIAGNOSIS = Diagnosis(
    "missing-physics", (MISMATCH,), (CUBIC,), (), FIT, {"seed": 1},
    "Missing physics: cubic nonlinearity (y). Reduced chi^2 goes from 3.1 to 1.02.",
)  # fmt: skip


def curves(rows: int = 20, positions: int = 18) -> Curves:
    n = rows * positions
    position = np.repeat(np.arange(1, positions + 1), rows)
    before = np.stack([np.ones(n), np.where(position == 4, 2.0, 0.0)], axis=1)
    before[7, 1] = np.nan
    channels = (("specific_force", "x"), ("specific_force", "y"))
    return Curves(60.0 * np.arange(n), position, channels, before, 0 * before)


def campaign(runs: int = 200, ratio: float = 1.02, mean: float = 0.0, failed: int = 0) -> CampaignSummary:
    """The summary of a campaign.json; the second parameter errs by `ratio`."""
    sigma = 9.80665e-6
    rows = [{"parameter": f"bias:{a}", "unit": "SI", "runs": runs, "mean": mean * sigma if a == "y" else 0.0,
             "rms": r * sigma, "sigma": sigma, "ratio": r} for a, r in (("x", 0.97), ("y", ratio))]  # fmt: skip
    return entry_from(CampaignSummary, {
        "format": 1, "sha256": "0" * 64, "direction": "physics to readings", "runs": runs, "failed": failed,
        "outcomes": {"the fit did not settle": failed} if failed else {}, "parameters": rows, "in_words": "",
        "identity": {"scenario": "0" * 64, "name": "wu2018-18", "kind": "multi-position", "seed": 1,
                     "method": "three-stage", "share": 4, "version": "0.1.0"},
    }, "campaign.json")  # fmt: skip


@cache
def page(name: str) -> str:
    """One of `PAGES`."""
    return PAGES[name]()


def of_forces(verdict: str = "missing-physics", **changes: Any) -> str:
    """The page of a diagnosis of positions, in a known noise and at a known temperature."""
    warm = {"temperature [°C]": np.linspace(15, 25, 360)}
    known = replace(curves(), sigma=np.full((360, 2), 5.0), units=("ug", "ug"), against=warm)
    if verdict == "adequate":
        known = replace(known, after=known.before)
    return diagnosis_report(replace(DIAGNOSIS, verdict=verdict, curves=known, **changes), LONG)


def pointing_page() -> str:
    """The page of a telescope of seven terms, calibrated by sixty stars with one outlier."""
    night = run(ALT_AZ, sky(ALT_AZ, 60), effects(ALT_AZ, axis_collimation=60.0, base_tilt__north=25.0), 1.0)
    elevation = night.channels["true_angle", "elevation"].copy()
    elevation[16] += np.radians(0.025)
    night = night.with_channels({("true_angle", "elevation"): elevation})
    calibration = pointing_calibration([night])
    origin = replace(calibration.provenance, created=None, recordings=())
    return calibration_report(replace(calibration, provenance=origin), [night])


LAW = LawResult(
    "specific_force", "y", ("force_y", "temperature"), "0.2*force_y*Heaviside(temperature - 23.003)",
    "a*force_y*Heaviside(temperature - 23.003)", "ug", r"a f_y \operatorname{H}(T - 23.0)",
    (Estimate("a", None, 20.81, 1.0, "ug/g"),), {"force_y": (-1.0, 1.0), "temperature": (19.0, 27.5)},
    {"force_y": "g", "temperature": "degC"}, 40.0, 3.3, 1.05, ("a*force_y**3",), "law_specific_force_y",
    "law_specific_force_y", ("bias_temperature:y",),
)  # fmt: skip

PAGES: dict[str, Callable[[], str]] = {
    "calibration": lambda: calibration_report(*example()),
    "diagnosis": of_forces,
    "open": lambda: of_forces(
        "not-identifiable",
        findings=(replace(CUBIC, twins=("odd_quadratic",), separate_by="Tilt by 30 and 60 degrees."),),
    ),
    "unexplained": lambda: of_forces("unexplained", findings=(), unexplained=(Shape("x", "grows with time"),)),
    "adequate": lambda: of_forces("adequate", findings=(), mismatch=()),
    "law": lambda: of_forces("unexplained", findings=(), laws=(LAW,)),
    "pointing": pointing_page,
    "mount": lambda: diagnosis_report(replace(DIAGNOSIS, curves=mount()), LONG),
    "noise": lambda: noise_report(rest_noise(bench()), LONG),
    "observe": lambda: plan_report(observe("wu2018-18", candidates=["cross_coupling"])),
    "observe_static": lambda: plan_report(observe_any("static-24h", 1.0, 2.0, 40.0)),
    "turns": lambda: observability_report(observe_turning("jia2014-9", 40.0, "bias,gyro_bias")),
    "design": lambda: design_report(design(rig_of("space-stable", 90, None), 6, ("bias",))),
    "designed_turns": lambda: design_report(TURNS),
    "budget": lambda: budget_report(budget(["wu2018-18"], (6.0, 24.0))),
    "navigation": lambda: navigation_report(summary(navigated(), Aids(), NavigationInputs(samples=5), LONG)),
    "history": lambda: history_report(HISTORY),
    "campaign": lambda: campaign_report(campaign(ratio=1.7, failed=2)),
    "new": lambda: proposal_page(log()),
}


def bench() -> Recording:
    """A unit at rest, logged for a minute."""
    rng = np.random.default_rng(1)
    force = G0 * np.array([0.0, 0.0, 1.0]) + 0.01 * rng.standard_normal((3000, 3))
    return from_arrays(np.arange(3000) / 50, specific_force=force, title=LONG, units={"specific_force": "m/s^2"})


def log() -> Proposal:
    """What `new` proposes of four rests that follow close on each other."""
    at = np.repeat(np.array([[0, 0, 1.0], [0, 1.0, 0], [1.0, 0, 0], [0, 0, -1.0]]), 200, axis=0)
    rng = np.random.default_rng(1)
    force = G0 * at + 0.01 * rng.standard_normal(at.shape)
    r = from_arrays(np.arange(800) / 50, specific_force=force, position=1 + np.arange(800) // 200, title=LONG,
                    units={"specific_force": "m/s^2"})  # fmt: skip
    why = f"its name '{LONG}'; at rest the three together are 9.823, and gravity is 9.807 m/s^2"
    return Proposal(r, {f"acc_{a}": Guess("specific_force", a, "m/s^2", why) for a in "xyz"}, (LONG,))


def mount() -> Curves:
    """Ninety stars, tilted before and scattered after."""
    rng = np.random.default_rng(1)
    around, up = rng.uniform(0, 360, 90), rng.uniform(20, 85, 90)
    tilt = 20 * np.stack([np.sin(np.deg2rad(around)), np.cos(np.deg2rad(around))], axis=1)
    left = rng.standard_normal((90, 2))
    return Curves(np.arange(90.0), np.arange(1, 91), (("pointing", "across"), ("pointing", "along")), tilt + left, left,
                  np.ones((90, 2)), ("arcsec", "arcsec"), {"azimuth [°]": around, "elevation [°]": up})  # fmt: skip


def navigated() -> list[Navigated]:
    """A day without a calibration and with two."""
    t = np.linspace(0, 86400, 300)
    swing = np.sin(t[:, None] / 806 + np.arange(7)) * [1e-4, 2e-4, 0.1, 0.1, 1e-4, 1e-4, 2e-4]
    return [Navigated(name, t, size * swing, size * 400 * np.abs(np.sin(t / 806)), *bands)
            for name, size, bands in (("none", 1.0, ()), ("monday", 0.1, (0.1 * np.abs(swing),) * 2),
                                      (LONG, 0.2, ()))]  # fmt: skip
