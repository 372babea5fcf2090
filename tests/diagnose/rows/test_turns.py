"""A unit turned from rest to rest: what grows with the rate is found in the turns, and only what is there."""

from dataclasses import replace

import pytest

from gimbalcal.diagnose import diagnose
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_of_turns
from tests.diagnose.shipped_unit import by_hand


@pytest.mark.parametrize(
    ("effect", "truth"),
    [
        ("gyro_scale_nonlinearity", {"x": 1000.0, "y": -800.0, "z": 600.0}),
        ("gyro_scale_asymmetry", {"x": 1500.0, "y": -1200.0, "z": 900.0}),
        ("gyro_scale_temperature", {"x": 300.0, "y": -250.0, "z": 200.0}),
        ("gyro_g_sensitivity_rate", {"xx": 30.0, "yz": -30.0, "zy": 30.0}),
    ],
)
def test_what_was_left_out_is_named_with_its_size(effect, truth):
    found = diagnose((by_hand(**{effect: truth}),)).to_dict()
    assert [f["effect"] for f in found["findings"]] == [effect]
    sizes = {p["axis"]: (p["value"], p["sigma"]) for p in found["findings"][0]["parameters"]}
    for axis, value in truth.items():
        # the sigma is that of a model without the products of two errors, 1e-3 of the size
        assert abs(sizes[axis][0] - value) < 4 * sizes[axis][1] + 0.01 * abs(value)


def test_a_linear_unit_is_adequate():
    assert diagnose((by_hand(),)).to_dict()["verdict"] == "adequate"


def test_no_rows_on_the_way_make_no_view():
    recording = by_hand()
    assert view_of_turns(recording) is not None
    at_rest = recording.position > 0
    still = {k: v[at_rest] for k, v in recording.channels.items()}
    bare = replace(recording, time=recording.time[at_rest], position=recording.position[at_rest], channels=still,
                   weight=recording.weight[at_rest])  # fmt: skip
    assert view_of_turns(bare) is None
