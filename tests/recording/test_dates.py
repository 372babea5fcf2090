"""Dates as seconds since the midnight of the first: zones count, and what Parquet holds is what was written."""

from datetime import UTC, date, datetime, timedelta

import numpy as np
import polars as pl
import pytest

from gimbalcal.recording.dates import Dates


def test_a_zone_in_the_east_is_earlier():
    cells = ["2026-11-18T05:00:00Z", "2026-11-18T05:00:00+01:30", "2026-11-18T05:00:00-0800", "2026-11-18 06:00:00+01"]
    dates = Dates()
    np.testing.assert_array_equal(dates.seconds(pl.Series(cells)) / 3600, [5.0, 3.5, 13.0, 5.0])
    assert dates.start == "2026-11-18 00:00 UTC"


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_instants_of_parquet_are_seconds_whatever_they_count_in(unit):
    begin = datetime(2026, 11, 18, 23, 59, 59, tzinfo=UTC)
    cells = pl.Series([begin, begin + timedelta(milliseconds=1500)]).cast(pl.Datetime(unit, "UTC"))
    np.testing.assert_allclose(Dates().seconds(cells), [86399.0, 86400.5], rtol=1e-14)


def test_days_of_parquet_are_days():
    np.testing.assert_array_equal(Dates().seconds(pl.Series([date(2026, 11, 18), date(2026, 11, 20)])), [0.0, 172800.0])
