"""The content of a calibration.json: its keys with their types, and checks of its numbers before they are used.

A file that was edited by hand, truncated, or written by another program is refused, and the message names the place of
the fault: it would otherwise correct recordings silently with a wrong unit or an impossible variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from gimbalcal.calibration.provenance import MountAxes
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.loading import EffectFile, files_outside
from gimbalcal.entries import Entry, Json
from gimbalcal.errors import InputError, shortened_text
from gimbalcal.inference.information import Unobservable
from gimbalcal.number import Array
from gimbalcal.units import from_si, parse, to_si

MAX_NUMBER = 1e100  # its square is finite, too
MOUNT_AXES = {"alt-az": ("elevation", "azimuth"), "equatorial": ("declination", "hour_angle", "polar")}
SIGMA_TOLERANCE = 1e-3  # relative, of a sigma and its variance: people round to three digits
MAX_VALUE = 1e6  # usual sizes; raw units differ by thousands
CORRELATION_TOLERANCE = 1e-6  # of a correlation matrix: symmetry, and how negative an eigenvalue may be
SHA_DIGITS = 12  # of a SHA-256 in a message


@dataclass(frozen=True)
class HistoryRow(Entry):
    """The history of a stage in calibration.json: a list over time for each label."""

    time_s: list[float]
    values: dict[str, list[float]]
    sigmas: dict[str, list[float]]


@dataclass(frozen=True)
class StageRow(Entry):
    """A stage in calibration.json; a number that is not finite is null."""

    name: str
    values: dict[str, float | None]
    sigmas: dict[str, float | None]
    rms: float | None
    in_words: str
    history: HistoryRow | None = None


@dataclass(frozen=True)
class ParameterRow(Entry):
    """A parameter in calibration.json; `refuse_unsound` checks its numbers."""

    name: str
    axis: str
    value: Any
    sigma: Any
    unit: str
    prior_sigma: Any = None
    effect: str | None = None
    covariate: str = ""


@dataclass(frozen=True)
class ResidualRow(Entry):
    """The residual in calibration.json; `refuse_misfit` checks its numbers."""

    chi2: Any
    dof: Any
    rms: dict[str, Any]
    navigation: Json | None = None


@dataclass(frozen=True)
class CalibrationFile(Entry):
    """Keys of calibration.json and their types; provenance and readout are read by their own modules."""

    method: str
    outcome: str
    parameters: tuple[ParameterRow, ...]
    covariance: Any
    unobservable: tuple[Unobservable, ...]
    residual: ResidualRow
    provenance: dict[str, Any]
    stages: tuple[StageRow, ...] = ()


def refuse_unsound(rows: Sequence[ParameterRow], known: Sequence[Parameter], covariance: Any) -> None:
    """Raise InputError where parameters or covariance [SI] cannot be those of a calibration.

    known: the parameter that each row names.
    """
    row_of: dict[str, int] = {}
    for i, (row, p) in enumerate(zip(rows, known, strict=True), start=1):
        if p.label in row_of:
            raise InputError(f"parameters {row_of[p.label]} and {i} are both {p.label}; keep one of them")
        row_of[p.label] = i
        unit = row.unit
        if parse(unit).dimension != parse(p.unit).dimension:
            raise InputError(
                f"parameter {i}, {p.label}, is in {unit!r}, which is not a unit of it; give it in {p.unit}"
            )
        for name, number in (("value", row.value), ("sigma", row.sigma)):
            if not _is_finite_number(number):
                raise InputError(
                    f"parameter {i}, {p.label}: its {name} must be a finite number, got {shortened_text(repr(number))}"
                )
        if row.sigma < 0:
            raise InputError(f"parameter {i}, {p.label}: its sigma is negative, {row.sigma:g} {unit}")
        if abs(float(to_si(float(row.value), unit))) > MAX_VALUE * p.sigma:
            raise InputError(f"parameter {i}, {p.label}: {float(row.value):g} {unit} is beyond anything that is built")
        prior = row.prior_sigma
        if prior is not None and not (_is_finite_number(prior) and prior > 0):
            raise InputError(
                f"parameter {i}, {p.label}: its prior_sigma must be above zero, got {shortened_text(repr(prior))}"
            )
        if row.effect not in (None, p.effect):
            raise InputError(
                f"parameter {i}, {p.label}, is of the effect {p.effect}, not of {shortened_text(repr(row.effect))}"
            )
    _refuse_covariance(rows, known, covariance)


def _is_finite_number(number: Any) -> bool:
    """Return whether a value is a number that a float can hold."""
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        return False
    try:
        return isfinite(number)
    except OverflowError:
        return False


def refuse_misfit(residual: ResidualRow) -> None:
    """Raise InputError where the residual of a calibration.json has a number that is not zero or more."""
    named = {"chi2": residual.chi2, "dof": residual.dof, **residual.rms}
    for name, number in named.items():
        if not (_is_finite_number(number) and 0 <= number < MAX_NUMBER):
            raise InputError(
                f"residual / {name} must be a finite number of zero or more, got {shortened_text(repr(number))}"
            )


def refuse_mount(mount: MountAxes) -> None:
    """Raise InputError where the axes or the latitude of a mount cannot be those of its kind."""
    if len(mount.axes) != len(MOUNT_AXES.get(mount.kind, mount.axes)):
        axes = shortened_text(repr(list(mount.axes)))
        raise InputError(f"provenance / mount / axes cannot be {axes} on a mount {mount.kind!r}")
    latitude = mount.latitude_deg
    if latitude is not None and not abs(latitude) <= 90:
        raise InputError(f"provenance / mount / latitude_deg must lie between -90 and 90, got {latitude}")


def refuse_other_definitions(ids: Sequence[str], files: Sequence[EffectFile]) -> None:
    """Raise InputError where the catalogue lacks an effect of `ids`, or defines it in another text than when fitted.

    files: those of a user's own effects, as a calibration.json states them.
    """
    stated = {i: file for file in files for i in file.effects}
    loaded = {i: file for file in files_outside() for i in file.effects}
    for i in ids:
        row, now = stated.get(i), loaded.get(i)
        if i not in CATALOGUE:
            file = f"{row.path} (its SHA-256 was {row.sha256[:SHA_DIGITS]}...)" if row else "FILE.py"
            raise InputError(
                f"calibration holds the effect {i!r}, which the catalogue does not have; give the file that "
                f"defines it with --effects {file}"
            )
        if row and now and now.sha256 != row.sha256:
            raise InputError(
                f"calibration holds the effect {i!r} of {row.path} (SHA-256 {row.sha256[:SHA_DIGITS]}...), and "
                f"{now.path} defines it differently ({now.sha256[:SHA_DIGITS]}...), so its numbers may "
                "have another meaning; give the original file, or calibrate again"
            )


def refuse_not_finite(content: Json, title: str) -> None:
    """Raise InputError where a calibration of the recordings called `title` has a number that is not finite."""
    named: list[tuple[str, Any]] = [
        (f"{p['name']} {p['axis']}".strip(), (p["value"], p["sigma"])) for p in content["parameters"]
    ]
    residual = content["residual"]
    named += [("the residual", (residual["chi2"], *residual["rms"].values()))]
    named += [("the covariance", np.ravel(np.asarray(content["covariance"], dtype=float)))]
    for name, numbers in named:
        if not np.isfinite(np.asarray(numbers, dtype=float)).all():
            raise not_finite(title, name)


def not_finite(title: str, name: str) -> InputError:
    """Return the error for `name` of an estimate from the recordings called `title` that is not finite."""
    return InputError(
        f"no constants of this model fit {title}: {name} is not finite; check signs, axes and units in "
        "[columns], single readings far from their neighbours, and the site"
    )


def _refuse_covariance(rows: Sequence[ParameterRow], known: Sequence[Parameter], covariance: Any) -> None:
    n = len(rows)
    try:
        P: Array = np.array(covariance, dtype=float).reshape((n, n) if np.size(covariance) == n * n else (-1,))
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"the covariance must be {n} rows of {n} numbers, one of each for every parameter") from None
    if P.shape != (n, n) or np.shape(covariance) not in ((n, n), (0,)):
        raise InputError(f"the covariance has shape {np.shape(covariance)}, and {n} parameters need ({n}, {n})")
    if not (np.abs(P) < MAX_NUMBER).all():
        i, j = np.argwhere(~(np.abs(P) < MAX_NUMBER))[0]
        raise InputError(f"the covariance of {known[i].label} and {known[j].label} is not a finite number")
    for p, variance, row in zip(known, np.diag(P), rows, strict=True):
        if variance < 0:
            raise InputError(f"the variance of {p.label} is negative, {variance:.3g}")
        sigma_of = float(from_si(float(np.sqrt(variance)), row.unit))
        if abs(sigma_of - row.sigma) > SIGMA_TOLERANCE * max(sigma_of, row.sigma):
            raise InputError(
                f"the sigma of {p.label} is {row.sigma:.4g} {row.unit} and the covariance gives {sigma_of:.4g}; "
                "correct the one that was changed"
            )
    sigma = np.sqrt(np.diag(P))
    R = P / np.outer(*(np.where(sigma > 0, sigma, 1.0),) * 2)
    symmetric = n == 0 or np.abs(R - R.T).max() <= CORRELATION_TOLERANCE
    if n and not (symmetric and np.linalg.eigvalsh((R + R.T) / 2)[0] >= -n * CORRELATION_TOLERANCE):
        raise InputError("the covariance must be symmetric and have no negative eigenvalue")
