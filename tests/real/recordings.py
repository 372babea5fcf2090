"""The real recordings, imported from their raw files where these are; nothing of them is copied into the project."""

from functools import cache
from typing import Any

import pytest

from gimbalcal.diagnose import Diagnosis, diagnose
from gimbalcal.importers import import_files
from gimbalcal.recording import Recording
from tests.paths import REAL

FILES = {
    "xsens": ("imu-tk", "imu_tk_xsens/xsens_acc.mat", "imu_tk_xsens/xsens_gyro.mat"),
    "tilt table": ("tilt-table", "tilt_table/tilt_table_200hz.npz"),
    "mmt": ("mmt", "mmt_pointing/point_20210821.dat"),
    "cgx-l": ("tpoint", "gem_mount_pointing/cgx-l-data.dat"),
    "warp-astron": ("tpoint", "gem_mount_pointing/warp-astron.dat"),
    "mikoff": ("mikoff", "mikoff_mpu9150/imu0.log"),
}


@cache
def recording(name: str) -> Recording:
    """A real recording; the test is skipped with a sentence where its files are not."""
    kind, *files = FILES[name]
    paths = [REAL / f for f in files]
    for path in paths:
        if not path.is_file():
            pytest.skip(f"{path} is not on this machine: the real recording {name!r} stays untested here")
    return import_files(kind, paths)


def diagnosed(name: str, *baseline: str) -> Diagnosis:
    """What is found missing when the model holds `baseline` alone (nothing named: the usual effects of its kind)."""
    return diagnose([recording(name)], baseline=baseline)


def finding(d: Diagnosis, effect: str) -> Any:
    """The finding that names an effect."""
    return next(f for f in d.findings if f["effect"] == effect)


def size(d: Diagnosis, name: str, axis: str = "") -> tuple[float, float]:
    """Value and sigma of a parameter in printed units."""
    p = next(p for f in d.findings for p in f["parameters"] if (p["name"], p["axis"]) == (name, axis))
    return float(p["value"]), float(p["sigma"])


def names(d: Diagnosis) -> set[str]:
    """The effects that are named."""
    return {f["effect"] for f in d.findings}


def rms_after(fit: Any, effect: str) -> float:
    """Rms misfit once an effect has been added to those before it."""
    return float(next(s["rms"] for s in fit["steps"] if s["effect"] == effect))
