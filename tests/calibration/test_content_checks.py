"""A calibration.json that was edited, cut or damaged is refused with the place of the fault."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual, read
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.errors import InputError
from tests.golden import refused

Content = dict[str, Any]


def content():
    wanted = tuple(p for i in ("scale_factor", "bias") for p in parameters(CATALOGUE[i]))
    sigma = np.array([p.sigma for p in wanted])
    R = 0.9 * np.eye(6) + 0.1
    made = Calibration("t", with_values((), wanted, sigma), wanted, R * np.outer(sigma, sigma), (), Residual(1, 1, {}))
    return made.to_dict()


def row(k, **changed):
    return lambda c: c["parameters"][k].update(changed)


def cell(i, j, value):
    def change(c):
        c["covariance"][i][j] = value

    return change


def twice(c):
    c["parameters"][4] = dict(c["parameters"][3])


def fully_correlated_with_all(c):
    P = c["covariance"]
    for j in range(3):
        P[0][j] = P[j][0] = (1.0 if j == 0 else (-1) ** j * 0.99) * (P[0][0] * P[j][j]) ** 0.5


FAULTS: list[Callable[[Content], None]] = [
    row(3, unit="arcsec"),
    row(3, unit="furlong"),
    row(1, value=float("nan")),
    row(1, value="12"),
    row(1, value=True),
    row(1, value=10**400),
    row(1, value=1e300),
    row(1, prior_sigma=0.0),
    row(1, effect="bias"),
    row(1, sigma=-1.0),
    row(5, sigma=1e3),
    cell(4, 4, -1e-12),
    cell(0, 5, float("inf")),
    cell(0, 5, "x"),
    cell(0, 5, 0.5),
    fully_correlated_with_all,
    twice,
    lambda c: c.update(covariance=[[1.0]]),
    lambda c: c.update(covariance=[0.0] * 36),
]


@pytest.mark.parametrize("change", FAULTS)
def test_a_damaged_calibration_is_refused(tmp_path, change):
    path, told = tmp_path / "calibration.json", content()
    path.write_text(json.dumps(told))
    assert len(read(path).parameters) == 6
    change(told)
    path.write_text(json.dumps(told))
    with refused():
        read(path)


def test_a_file_that_is_none_is_refused(tmp_path):
    deep = tmp_path / "deep.json"
    deep.write_text("[" * 100_000)
    for path, words in ((Path("/dev/zero"), "there is no /dev/zero"), (deep, "too many brackets")):
        with pytest.raises(InputError, match=words):
            read(path)
