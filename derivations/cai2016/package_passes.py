"""The package's alignment, error model, filter and smoother for Eqs. (13) to (27): see `derivations.passes`."""

from __future__ import annotations

from derivations import navigator_at_rest as rest
from derivations import passes
from derivations.cai2016.symbols import SOURCE
from derivations.comparison import Check, checks

ALIGNED, MODEL, PASS = "alignment", "error_model.stretch_model", "filter_pass.filter_and_smooth"
# numbers of equations, place in `estimate.systematic`, what compares it, what steps and iterations leave
PLACES: tuple[tuple[tuple[int | str, ...], str, Check, float], ...] = (
    ((17,), f"{ALIGNED}.align", passes.alignment, 1e-4),
    ((17,), f"{ALIGNED}.attitudes", passes.levelled, 1e-6),
    ((17,), f"{ALIGNED}.attitudes", passes.levelled_on_the_way, 1e-6),
    (("23), F21", 24), MODEL, passes.stretch, 1e-4),
    ((24,), MODEL, passes.stretch_by_biases, 1e-4),
    ((24,), MODEL, passes.end_of_stretch, 1e-6),
    ((24,), "error_model.expected_readings", passes.expected, 1e-4),
    ((17, "27), navigation"), "error_model.rotated", passes.corrected_attitude, 1e-12),
    ((13, 25, 26), PASS, passes.first_step, 5e-2),
    ((13,), PASS, passes.calibrated_innovations, 0.2),
    ((13,), "filter_pass.data_information", passes.information_of_data, 1e-9),
    ((13, 17, 21, 25, 27), "iterate.iterate", passes.passes, 5e-2),
    ((13,), "calibrate.calibration_of_fit", passes.stated_calibration, 1e-6),
    ((13,), "calibrate._joint_information", passes.joint_information, 1e-9),
    ((1, 4), "error_model.invert_readings", passes.inverted, 1e-11),
)


def _item(number: int | str) -> str:
    """Return "Eq. (17)" of 17, "Eq. (23), F21" of "23), F21"."""
    return f"Eq. ({number})" if isinstance(number, int) else f"Eq. ({number}"


for _numbers, _place, _check, _tolerance in PLACES:
    _items = map(_item, _numbers)
    checks(SOURCE, *_items, where=f"estimate.systematic.{_place}", tolerance=_tolerance)(_check)
checks(SOURCE, "Eq. (17)", where="earth.rate_at")(rest.earth_rate)
checks(SOURCE, "Eq. (17)", where="rotation.mean_rates")(rest.rotation_of_samples)
checks(SOURCE, "Eq. (1)", "Eq. (4)", where="recording.increments")(rest.increments)
checks(SOURCE, "Eq. (1)", "Eq. (4)", where="navigate.strapdown_unit.thinned_intervals")(passes.mean_readings)
