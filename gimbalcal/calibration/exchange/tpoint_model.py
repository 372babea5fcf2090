r"""TPOINT model files: the terms of a mount under the names and signs of Wallace's program, and back.

TPOINT counts every term as *true minus raw*, what has to be added to the reported position to get where the telescope
looks: hour angle positive westwards, a tube that sags has a positive TF. For a two-axis mount, to first order, with L
the latitude, h, d hour angle and declination, and A, E azimuth (from north through east) and elevation:

=====  ======================================================  ======================================================
term   true minus raw                                          ours
=====  ======================================================  ======================================================
IH     dh = IH                                                 zero (hour) - tilt (north) cos L + tilt (down) sin L
ID     dd = ID                                                 zero (declination)
CH     dh = CH sec d                                           axis collimation
NP     dh = NP tan d                                           nonorthogonality (declination)
MA     dh = -MA cos h tan d, dd = MA sin h                     tilt (north) sin L + tilt (down) cos L
ME     dh = ME sin h tan d, dd = ME cos h                      - tilt (east)
IA     dA = -IA                                                - zero (azimuth) - tilt (down)
IE     dE = IE                                                 zero (elevation)
CA     dA = -CA sec E                                          - axis collimation
NPAE   dA = -NPAE tan E                                        - nonorthogonality (elevation)
AN     dA = -AN sin A tan E, dE = -AN cos A                    - tilt (east): the mount's pole leans north
AW     dA = -AW cos A tan E, dE = AW sin A                     - tilt (north): the mount's pole leans west
TF     d(zenith distance) = TF sin(zenith distance)            tube flexure
TX     d(zenith distance) = TX tan(zenith distance)            refraction
HCES   dh = HCES sin h; HCEC, DCES, DCEC, ECES, ECEC likewise  eccentricity
ACES   dA = -ACES sin A; dA = ACEC cos A                       - eccentricity sin, eccentricity cos
HHSH2  dh = HHSH2 sin 2h; HHCH2, HDSD2, HESE2 and so on        two cycle
HASA2  dA = HASA2 sin 2A; dA = -HACA2 cos 2A                   two cycle sin, - two cycle cos
PHH    dh = PHH h, in radians; PDD, PEE likewise               encoder scale factor
=====  ======================================================  ======================================================

TPOINT's own azimuth runs from south through east, which turns the signs of everything in azimuth. Source: Wallace,
TPOINT (nomenclature of the terms; to which side a positive coefficient displaces the pointing axis). The tests hold
each against the forward model. A file has a caption, a line of method, stars and sky rms, then a term, its value and
its sigma [arcsec] to a line, and END.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, radians, sin
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.content_checks import MOUNT_AXES
from gimbalcal.calibration.matrices import Imported, ParameterTable
from gimbalcal.calibration.provenance import MountAxes, PrintedTerm
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.errors import InputError
from gimbalcal.platform import Platform
from gimbalcal.units import from_si, to_si

ALT_AZ, EQUATORIAL = "alt-az", "equatorial"
AXES = MOUNT_AXES
Weights = dict[str, dict[str, float]]
UNIT = "arcsec"
_PLACE = re.compile(r"latitude\s*[:=]?\s*([-+]?\d+(?:\.\d+)?)", re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?$")
_TERM = re.compile(r"^[&=]*\s*([A-Z][A-Z0-9]*)\s+(\S+)(?:\s+(\S+))?\s*$")


@dataclass(frozen=True)
class TpointTerm:
    """A term of a TPOINT model [rad]."""

    name: str
    value: float
    sigma: float


def mount_of(platform: Platform) -> str:
    """Return the mount of a platform, alt-azimuth or equatorial, by its axes; empty for any other."""
    turns = "".join(axis.direction for axis in platform.axes)
    upright = all(axis.sign == 1 for axis in platform.axes)
    return {"yz": ALT_AZ, "yzy": EQUATORIAL}.get(turns, "") if upright else ""


def mount_axes(platform: Platform, latitude: float | None) -> MountAxes:
    """Return the mount by which its terms have names in TPOINT."""
    return MountAxes(
        mount_of(platform), platform.axis_names, None if latitude is None else float(from_si(latitude, "deg"))
    )


def tpoint_terms(calibration: Calibration) -> tuple[TpointTerm, ...]:
    """Return the terms of a pointing calibration in TPOINT's convention; none for a mount or effect without a name."""
    rows = _weights_of_terms(calibration.provenance.mount)
    labels = [p.label for p in calibration.parameters]
    out = []
    for name, weights in rows.items():
        w = np.array([weights.get(label, 0.0) for label in labels])
        if np.any(w):
            variance = max(float(w @ calibration.covariance @ w), 0.0)
            out.append(TpointTerm(name, float(w @ calibration.values), float(np.sqrt(variance))))
    return tuple(out)


def term_names(platform: Platform) -> dict[str, str]:
    """Return the name in TPOINT of each parameter of a mount, by label; of one in two terms that of the latter."""
    rows = _weights_of_terms(MountAxes(mount_of(platform), platform.axis_names, 45.0))
    return {label: name for name, weights in rows.items() for label in weights}


def parameters_without_term(calibration: Calibration) -> list[str]:
    """Return labels of the parameters that TPOINT has no term for."""
    rows = _weights_of_terms(calibration.provenance.mount)
    place = {label for weights in rows.values() for label in weights}
    return [p.label for p in calibration.parameters if p.label not in place]


def _weights_of_terms(mount: MountAxes | None) -> Weights:
    """Return each term as a sum of our parameters, label to weight; none where the mount has no names in TPOINT."""
    return TERMS[mount.kind](mount) if mount and mount.kind in TERMS else {}


def _alt_az(mount: MountAxes) -> Weights:
    up, around = mount.axes
    return {
        "IA": {f"gimbal_zero:{around}": -1, "base_tilt:down": -1},
        "IE": {f"gimbal_zero:{up}": 1},
        "CA": {"axis_collimation": -1},
        "NPAE": {f"nonorthogonality:{up}": -1},
        "AN": {"base_tilt:east": -1},
        "AW": {"base_tilt:north": -1},
        "TF": {"tube_flexure": 1},
        "TX": {"refraction": 1},
        "ECES": {f"eccentricity_sin:{up}": 1},
        "ECEC": {f"eccentricity_cos:{up}": 1},
        "ACES": {f"eccentricity_sin:{around}": -1},
        "ACEC": {f"eccentricity_cos:{around}": 1},
        "HESE2": {f"two_cycle_sin:{up}": 1},
        "HECE2": {f"two_cycle_cos:{up}": 1},
        "HASA2": {f"two_cycle_sin:{around}": 1},
        "HACA2": {f"two_cycle_cos:{around}": -1},
        "PEE": {f"encoder_scale_factor:{up}": 1},
    }


def _equatorial(mount: MountAxes) -> Weights:
    if mount.latitude_deg is None:  # the vertical is not known in the axes of the mount
        return {}
    (up, around, polar), L = mount.axes, radians(mount.latitude_deg)
    return {
        "IH": {f"gimbal_zero:{around}": 1, "base_tilt:north": -cos(L), "base_tilt:down": sin(L)},
        "ID": {f"gimbal_zero:{up}": 1},
        "CH": {"axis_collimation": 1},
        "NP": {f"nonorthogonality:{up}": 1},
        "MA": {"base_tilt:north": sin(L), "base_tilt:down": cos(L), f"nonorthogonality:{around}": -1},
        "ME": {"base_tilt:east": -1, f"gimbal_zero:{polar}": -1},
        "TF": {"tube_flexure": 1},
        "TX": {"refraction": 1},
        "HCES": {f"eccentricity_sin:{around}": 1},
        "HCEC": {f"eccentricity_cos:{around}": 1},
        "DCES": {f"eccentricity_sin:{up}": 1},
        "DCEC": {f"eccentricity_cos:{up}": 1},
        "HHSH2": {f"two_cycle_sin:{around}": 1},
        "HHCH2": {f"two_cycle_cos:{around}": 1},
        "HDSD2": {f"two_cycle_sin:{up}": 1},
        "HDCD2": {f"two_cycle_cos:{up}": 1},
        "PHH": {f"encoder_scale_factor:{around}": 1},
        "PDD": {f"encoder_scale_factor:{up}": 1},
    }


TERMS: Mapping[str, Callable[[MountAxes], Weights]] = {ALT_AZ: _alt_az, EQUATORIAL: _equatorial}
NAMES_ON = {kind: tuple(terms(MountAxes(kind, AXES[kind], 0.0))) for kind, terms in TERMS.items()}
NAMES = frozenset[str]().union(*NAMES_ON.values())


def content(calibration: Calibration, lost: Sequence[str]) -> bytes:
    """Return the model file. Raises InputError for a calibration of any other mount."""
    terms = tpoint_terms(calibration)
    mount = calibration.provenance.mount
    if not terms or mount is None:
        raise InputError(
            "this calibration has no term of an alt-azimuth or equatorial mount, so TPOINT has no name for it; give "
            "one that `gimbalcal calibrate` made of a pointing run"
        )
    place = f", latitude {mount.latitude_deg:.8f} deg" if mount.latitude_deg is not None else ""
    rms = float(np.sqrt(sum(v**2 for v in calibration.residual.rms.values())))
    stars = calibration.provenance.stars or 0
    lines = [f"gimbalcal {mount.kind} mount{place}", f"T {stars:5d} {_arcsec(rms):10.4f}   0.000  0.0000"]
    lines += [f"  {t.name:<8s} {_arcsec(t.value):+14.5f} {_arcsec(t.sigma):11.5f}" for t in terms]
    return ("\n".join([*lines, "END", *(f"! {words}" for words in lost)]) + "\n").encode()


def _arcsec(x: float) -> float:
    return float(from_si(x, UNIT))


def read(path: Path) -> Imported:
    """Return value and sigma of each parameter, and the mount, by whose axes they are counted."""
    terms, caption = _terms(path)
    upright = set(terms) & NAMES.difference(NAMES_ON[EQUATORIAL]) or ALT_AZ in caption.lower()
    kind, stated = ALT_AZ if upright else EQUATORIAL, _PLACE.search(caption)
    mount = MountAxes(kind, AXES[kind], float(stated[1]) if stated else None)
    unknown = [name for name in terms if name not in NAMES_ON[kind]]
    if unknown:
        raise InputError(
            f"{path}: {', '.join(unknown)} has no effect here that it could become on an {kind} mount; there are "
            f"{', '.join(NAMES_ON[kind])}: fit the model again without the others"
        )
    if "MA" in terms and mount.latitude_deg is None:
        raise InputError(
            f"{path}: MA turns the mount about the vertical by an angle that depends on the latitude; write it into "
            'the first line, as in "latitude 39.007 deg"'
        )
    return Imported(_parameters(replace(mount, latitude_deg=mount.latitude_deg or 0.0), terms), mount.axes, mount)


def _parameters(mount: MountAxes, terms: Mapping[str, TpointTerm]) -> ParameterTable:
    """Return our parameters of the terms: each of the first in its sum, but for MA, a turn of the mount about the
    horizontal and the vertical without one about its pole.
    """
    every = _weights_of_terms(mount)
    rows = {n: dict([next(iter(w.items()))]) for n, w in every.items()}
    if "MA" in every:
        rows["MA"] = {label: every["MA"][label] for label in ("base_tilt:north", "base_tilt:down")}
    by_label = {p.label: p for cls in CATALOGUE.values() for p in parameters(cls, mount.axes)}
    out: ParameterTable = {}
    for name, term in terms.items():
        for label, w in rows[name].items():
            out[by_label[label]] = (term.value * w, term.sigma * abs(w))
    return out


def _terms(path: Path) -> tuple[dict[str, TpointTerm], str]:
    """Return terms by name in the order of the file, and its caption."""
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    out: dict[str, TpointTerm] = {}
    for number, line in enumerate(lines, start=1):
        if line.strip() == "END":
            break
        match = _TERM.match(line.strip())
        caption = number == 1 and (not match or match[1] not in NAMES)
        first, *numbers = line.split() or [""]
        method = first in ("S", "T") and bool(numbers) and all(map(_NUMBER.match, numbers))  # stars and rms on the sky
        if line.startswith("!") or caption or not line.strip() or method:
            continue
        try:
            value, sigma = (float(to_si(float(x or 0), UNIT)) for x in match.groups()[1:]) if match else (0.0, -1.0)
        except ValueError:
            value, sigma = 0.0, -1.0
        if match is None or not np.isfinite(value) or not 0 <= sigma < np.inf:
            raise InputError(
                f"{path}, line {number}: {line.strip()[:60]!r} is no term, value and sigma, as in `IH  -12.3  0.4`"
            )
        if match[1] in out:
            raise InputError(f"{path}, line {number}: {match[1]} is there twice; keep one of them")
        out[match[1]] = TpointTerm(match[1], value, sigma)
    if not out:
        raise InputError(f"{path} is not a TPOINT model: a line for each term is wanted, as in `IH  -12.3  0.4`")
    if "END" not in (line.strip() for line in lines):
        raise InputError(f"{path} has no END, so it may be cut short; write END below its last term")
    return out, lines[0]


def printed(terms: Sequence[TpointTerm], before: Sequence[TpointTerm] = ()) -> tuple[PrintedTerm, ...]:
    """Return terms in their unit of print, as calibration.json states them, with the change since the model before."""
    old = {t.name: t.value for t in before}
    return tuple(
        PrintedTerm(t.name, _arcsec(t.value), _arcsec(t.sigma), UNIT, _arcsec(t.value - old.get(t.name, 0.0)))
        for t in terms
    )
