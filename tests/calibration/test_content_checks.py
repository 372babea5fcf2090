"""A calibration.json that was edited, cut or damaged is refused with the place of the fault."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gimbalcal.calibration import Calibration, Residual, read
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.errors import InputError

Content = dict[str, Any]


def content() -> Content:
    wanted = tuple(p for i in ("scale_factor", "bias") for p in parameters(CATALOGUE[i]))
    sigma = np.array([p.sigma for p in wanted])
    R = 0.9 * np.eye(6) + 0.1
    made = Calibration("t", with_values((), wanted, sigma), wanted, R * np.outer(sigma, sigma), (), Residual(1, 1, {}))
    return made.to_dict()


def row(k: int, **changed: Any) -> Callable[[Content], None]:
    return lambda c: c["parameters"][k].update(changed)


def cell(i: int, j: int, value: Any) -> Callable[[Content], None]:
    def change(c: Content) -> None:
        c["covariance"][i][j] = value

    return change


def twice(c: Content) -> None:
    c["parameters"][4] = dict(c["parameters"][3])


def fully_correlated_with_all(c: Content) -> None:
    P = c["covariance"]
    for j in range(3):
        P[0][j] = P[j][0] = (1.0 if j == 0 else (-1) ** j * 0.99) * (P[0][0] * P[j][j]) ** 0.5


FAULTS: list[tuple[Callable[[Content], None], str]] = [
    (row(3, unit="arcsec"), "parameter 4, bias:x, is in 'arcsec', which is not a unit of it; give it in ug"),
    (row(3, unit="furlong"), "the unit 'furlong' is not known"),
    (row(1, value=float("nan")), "parameter 2, scale_factor:y: its value must be a finite number, got nan"),
    (row(1, value="12"), "its value must be a finite number, got '12'"),
    (row(1, value=True), "its value must be a finite number, got True"),
    (row(1, value=10**400), "its value must be a finite number, got 1000"),
    (row(1, value=1e300), "parameter 2, scale_factor:y: 1e+300 ppm is beyond anything that is built"),
    (row(1, prior_sigma=0.0), "parameter 2, scale_factor:y: its prior_sigma must be above zero, got 0.0"),
    (row(1, effect="bias"), "parameter 2, scale_factor:y, is of the effect scale_factor, not of 'bias'"),
    (row(1, sigma=-1.0), "parameter 2, scale_factor:y: its sigma is negative, -1 ppm"),
    (row(5, sigma=1e3), "the sigma of bias:z is 1000 ug and the covariance gives"),
    (cell(4, 4, -1e-12), "the variance of bias:y is negative, -1e-12"),
    (cell(0, 5, float("inf")), "the covariance of scale_factor:x and bias:z is not a finite number"),
    (cell(0, 5, "x"), "the covariance must be 6 rows of 6 numbers"),
    (cell(0, 5, 0.5), "the covariance must be symmetric"),
    (fully_correlated_with_all, "the covariance must be symmetric"),
    (twice, "parameters 4 and 5 are both bias:x; keep one of them"),
    (lambda c: c.update(covariance=[[1.0]]), "the covariance has shape (1, 1), and 6 parameters need (6, 6)"),
    (lambda c: c.update(covariance=[0.0] * 36), "the covariance has shape (36,), and 6 parameters need (6, 6)"),
]


@pytest.mark.parametrize(("change", "words"), FAULTS, ids=[words[:40] for _, words in FAULTS])
def test_a_damaged_calibration_is_refused(tmp_path: Path, change: Callable[[Content], None], words: str) -> None:
    path, told = tmp_path / "calibration.json", content()
    path.write_text(json.dumps(told))
    assert len(read(path).parameters) == 6
    change(told)
    path.write_text(json.dumps(told))
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text("[" * 100_000)
    for path, words in ((Path("/dev/zero"), "there is no /dev/zero"), (deep, "is not a calibration.json")):
        with pytest.raises(InputError, match=words):
            read(path)
