"""What recording.toml may not say, and in which words it is refused."""

import re

import pytest

from gimbalcal.recording import read
from tests.golden import golden_text, refused
from tests.recording.folders import HEADER, folder, refusal

HEADER_FAULTS = [
    ("format = 1", "format = 2"),
    ('"multi-position"', '"tumble"'),
    ("[site]", "[sites]"),
    ("format = 1", "format = 1\ndate = 18"),
    ("format = 1", 'format = 1\ndate = "last week"'),
    ("latitude = {", "latitud = {"),
    ('{ value = 40.0, unit = "deg" }', "40.0"),
    ("value = 40.0", "value = 95.0"),
    ('40.0, unit = "deg"', '40.0, unit = "rad"'),
    ("value = 40.0", "value = nan"),
    ("9.80146", "980.146"),
    ('"space-stable"', '"stable-space"'),
    ('"ug"', '"count"'),
    ('"ug"', '"deg"'),
    ("value = 100.0", "value = -1.0"),
    ("accelerometer =", "accel ="),
    (', axis = "x", unit = "g"', ', axis = "x"'),
    ('axis = "x", unit = "g"', 'axis = "x", unit = "gee"'),
    ('axis = "x", unit = "g"', 'axis = "x", unit = "K"'),
    ('axis = "x", unit = "g"', 'axis = "x", unit = 9.8'),
    ('axis = "x", unit = "g"', 'axis = "x", unit = "count"'),
    ('axis = "y"', 'axis = "x"'),
    ('axis = "y"', 'axis = "w"'),
    ('axis = "middle"', 'axis = "tilt"'),
    ('"temperature"', '"warmth"'),
    ('time_s   = { quantity = "time", unit = "s" }\n', ""),
    ("samples.csv", "../samples.csv"),
    ("samples.csv", "/etc/hosts.csv"),
    ("samples.csv", "samples.xls"),
    ("samples.csv", "none.csv"),
    ("accel_y  =", "accel_v  ="),
    ('"space-stable"', '"bench"'),
]


@pytest.mark.parametrize(("old", "new"), HEADER_FAULTS)
def test_header_fault_is_refused(tmp_path, old, new):
    assert old in HEADER
    golden_text(refusal(tmp_path, HEADER.replace(old, new, 1)))


def test_a_header_that_is_no_toml_is_refused_by_line_and_column(tmp_path):
    assert "recording.toml, line 3, column" in refusal(tmp_path, HEADER.replace('"two positions"', '"two positions'))


def test_static_run_without_latitude_is_refused(tmp_path):
    header = re.sub(r"latitude .*\n", "", HEADER.replace("multi-position", "static-run"))
    golden_text(refusal(tmp_path, header))


def test_a_header_stands_for_its_folder(tmp_path):
    made = folder(tmp_path)
    assert read(made / "recording.toml").files == read(made).files


def test_no_folder_no_header(tmp_path):
    with refused():
        read(tmp_path / "nowhere")
    with refused():
        read(tmp_path)


def test_link_out_of_the_folder_is_refused(tmp_path):
    target = folder(tmp_path)
    (target / "samples.csv").rename(tmp_path / "elsewhere.csv")
    (target / "samples.csv").symlink_to(tmp_path / "elsewhere.csv")
    with refused():
        read(target)
