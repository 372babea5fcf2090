"""Units that output counts: parameters about one nominal scale and offset, in a fleet and over the years."""

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from gimbalcal.calibration import Counts, Readout
from gimbalcal.calibration.common_readout import common_readout, in_readout
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.errors import InputError
from gimbalcal.history import DatedCalibration, compare
from gimbalcal.history.fleet import fleet, with_fleet
from gimbalcal.methods import calibrate
from gimbalcal.recording import Source, read
from gimbalcal.recording.record import FORCE
from gimbalcal.report.history_page import history_report
from tests.history.calibrations import START

SENSITIVITIES = (1.0, *np.round(1 + 0.02 * np.random.default_rng(1).standard_normal(10), 4), 1.5)
OTHER = Readout(Counts((2.0e-3, 3.0e-3, 2.5e-3), (33000.0, 32000.0, 31000.0)))


@pytest.fixture(scope="module")
def recorded():
    return read(Path("data/xsens_positions"))


def with_sensitivity(r, factor, added=0.0):
    """The recording of a unit whose counts per force are `factor` times as many, about 32768 and an offset."""
    changed = {(FORCE, a): 32768 + added + factor * (r.channels[FORCE, a] - 32768) for a in "xyz"}
    return r.with_channels(changed)


@pytest.fixture(scope="module")
def calibrations(recorded):
    """Calibrations of units that differ in sensitivity: that of 1.0 and of 1.5 computed, the others written down."""
    out = {}
    first, _ = calibrate([recorded])
    for k, factor in enumerate(SENSITIVITIES):
        c = calibrate([with_sensitivity(recorded, factor)])[0] if factor == 1.5 else first
        if factor not in (1.0, 1.5):
            counts = first.readout.accelerometers
            offset = tuple(32768 + factor * (x - 32768) for x in counts.offset)
            c = replace(c, readout=Readout(Counts(tuple(x / factor for x in counts.scale), offset)))
        c = replace(c, provenance=replace(c.provenance, recordings=(Source("samples.csv", f"{k:064x}"),)))
        out[factor] = DatedCalibration(f"u{k}", START + timedelta(days=90 * k), c)
    return out


def test_the_counts_of_any_effect_belong_to_the_same_force(recorded):
    """Effects that bend, kink or shift the output are converted exactly, and converting back changes nothing."""
    names = ("bias", "scale_factor", "misalignment", "quadratic_nonlinearity", "cubic_nonlinearity", "odd_quadratic",
             "scale_factor_asymmetry", "dead_zone")  # fmt: skip
    wanted = tuple(p for name in names for p in parameters(CATALOGUE[name]))
    start, _ = calibrate([recorded])
    x = 3 * np.array([p.sigma for p in wanted]) * np.linspace(0.5, 1.0, len(wanted))
    c = replace(start, effects=with_values((), wanted, x), parameters=wanted, covariance=np.diag(x**2))
    other = in_readout(c, OTHER)
    assert other.readout == OTHER
    assert other.apply(recorded).triad(FORCE) == pytest.approx(c.apply(recorded).triad(FORCE), rel=1e-9, abs=1e-7)
    again = in_readout(other, c.readout)
    assert again.values == pytest.approx(c.values, rel=1e-9, abs=1e-15)
    assert again.sigmas == pytest.approx(c.sigmas, rel=1e-9)


def test_a_fleet_shows_how_the_sensitivity_of_its_units_differs(calibrations):
    known = fleet({d.name: d for d in calibrations.values()})
    for axis in "xyz":
        d = known.distributions[f"scale_factor:{axis}"]
        assert [d.units[i] for i in np.flatnonzero(~d.inside)] == ["u11"]
        scale = 1 / np.array(SENSITIVITIES)  # physical, relative to the first unit
        assert (1 + d.value) / (1 + d.value[0]) == pytest.approx(scale, rel=1e-4)
        assert d.spread == pytest.approx(scale[:-1].std(), rel=0.3)
    own = calibrations[1.5].calibration
    pulled = with_fleet(own, known)
    assert "scale factor x" in pulled.outcome
    assert pulled.readout == own.readout
    usual = with_fleet(calibrations[SENSITIVITIES[2]].calibration, known)
    assert not usual.outcome
    assert np.abs(usual.values - own.values) == pytest.approx(0, abs=1e-3)


def test_a_change_of_sensitivity_is_seen_and_none_is_not(calibrations, recorded):
    changed = compare([calibrations[1.0], calibrations[1.5]])
    assert not changed.agree
    assert changed.steps[0].p_value < 1e-6
    first = calibrations[1.0]
    again = replace(first, name="again", date=START + timedelta(days=9), calibration=replace(
        first.calibration, provenance=replace(first.calibration.provenance, recordings=())))  # fmt: skip
    same = compare([first, again])
    assert same.agree
    assert {f"{name}:{a}" for name in ("bias", "scale_factor") for a in "xyz"} <= {
        h.parameter.label for h in same.histories
    }


def test_counts_and_si_have_no_common_readout(calibrations):
    """A history refuses them; a fleet takes each parameter from the units that output as most do."""
    counts = [d.calibration for d in calibrations.values()]
    si = replace(counts[0], readout=Readout())
    assert common_readout([si, *counts]).accelerometers is not None
    assert common_readout([si, si, counts[0]]).accelerometers is None
    made = {d.name: d for d in calibrations.values()}
    known = fleet({**made, "si": replace(made["u0"], calibration=si)})
    assert "si" not in known.distributions["bias:x"].units
    assert "si" in known.distributions["misalignment:yz"].units
    with pytest.raises(InputError, match="counts"):
        compare([made["u0"], replace(made["u1"], calibration=si)])


def test_the_page_says_what_scale_and_offset_the_values_are_errors_of(calibrations):
    comparison = compare(list(calibrations.values())[:2]).printed
    page = history_report(comparison)
    scale = comparison.readout["accelerometers"]["scale"]
    assert f"errors of {scale[0]:.7g}" in page
