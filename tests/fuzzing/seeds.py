"""Sound inputs of every kind that gimbalcal reads, small ones: what the fuzzer changes."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.exchange import FORMATS, export
from gimbalcal.campaign.monte_carlo import run_campaign
from gimbalcal.earth import EARTH_RATE
from gimbalcal.history.unit_store import StoredResult, keep
from gimbalcal.methods import calibrate
from gimbalcal.platform import KNOWN
from gimbalcal.recording import Recording, read, write
from gimbalcal.schedule.file import rotation_toml, schedule_toml
from gimbalcal.schedule.published import ROTATIONS, SCHEDULES
from tests.paths import DATA, XSENS

DEVICE, STATIC, HAND = "device", "static", "hand"  # folders of recordings
COLUMNS = """
[columns]
"t" = { quantity = "time", unit = "s" }
"a[0]" = { quantity = "specific_force", axis = "x", unit = "m/s^2" }
"a[1]" = { quantity = "specific_force", axis = "y", unit = "m/s^2" }
"a[2]" = { quantity = "specific_force", axis = "z", unit = "m/s^2" }
"""
NAMES = ("Frame", "Time", "mount", "dx", "dy", "RARawDistance", "DECRawDistance", "RAGuideDistance", "DECGuideDistance",
         "RADuration", "RADirection", "DECDuration", "DECDirection", "XStep", "YStep", "StarMass", "SNR",
         "ErrorCode")  # fmt: skip
HEADER = 'format = 1\nkind = "multi-position"\n[platform]\nname = "bench"\n'


def make(folder: Path) -> None:
    """Every seed into `folder`."""
    device = read(DATA / "space_stable_18")
    few = device.select(np.arange(len(device.time)) % 10 == 0)
    write(few, folder / DEVICE)
    static = read(DATA / "space_stable_static")
    write(static.select(slice(None, 240)), folder / STATIC)
    shutil.copytree(XSENS, folder / HAND)
    for name, r, samples in (("device_parquet", few, "samples.parquet"), ("turning", _turning(), "samples.csv"),
                             ("stars", _stars(), "samples.csv")):  # fmt: skip
        write(r, folder / name, samples)
    calibration, _ = calibrate([folder / DEVICE])
    for kind, form in FORMATS.items():
        if kind != "tpoint":
            export(calibration, kind, folder / form.file)
    _kept(folder, calibration)
    scenario = (DATA / "space_stable_18" / "scenario.toml").read_text()
    (folder / "scenario.toml").write_text(scenario.replace("rate = { value = 0.1", "rate = { value = 0.01"))
    (folder / "schedule.toml").write_text(schedule_toml(SCHEDULES["wu2018-18"]))
    (folder / "turns.toml").write_text(rotation_toml(ROTATIONS["cai2016-18"]))
    run_campaign(folder / "scenario.toml", 2, folder / "camp", workers=1)
    _foreign(folder, few)


LAW = '''
"""An effect of one's own."""
import numpy as np
from gimbalcal.effects.effect import TRIAD, Effect, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array

@effect
class TwistedSpring(Effect):
    r"""The output follows the force times its cube across.

    .. math:: \\delta a_i = w_i f_x f_y^3
    """

    id = "twisted_spring"
    stage = Stage.ACCELEROMETER
    w: Array = parameter(TRIAD, unit="ug/g^4", sigma=50, name="twist")

    def contribution(self, s: Stimulus) -> Array:
        return self.w * (s.force[:, 0] * s.force[:, 1] ** 3)[..., None]
'''


def _kept(folder: Path, calibration: Calibration) -> None:
    """What a unit leaves over the months: calibrations, a store, a campaign, a mount's terms, a law."""
    content = calibration.to_dict()
    rng = np.random.default_rng(6)
    for month in range(1, 5):
        moved = json.loads(json.dumps(content))
        for row in moved["parameters"]:
            row["value"] += row["sigma"] * rng.standard_normal()
        moved["provenance"]["created"] = f"2026-0{month}-01T12:00:00+00:00"
        moved["provenance"]["recordings"] = [{"path": f"{month}", "sha256": f"{month}" * 64}]
        keep(folder / "unit.sqlite", StoredResult("a", moved["provenance"]["created"], "calibration", moved))
        (folder / f"month{month}.json").write_text(json.dumps(moved))
    mount, _ = calibrate([folder / "stars"])
    (folder / "mount.json").write_text(json.dumps(mount.to_dict()))
    (folder / "law.py").write_text(LAW)


def _foreign(folder: Path, few: Recording) -> None:
    """Files of other rigs."""
    (folder / "header.toml").write_text(HEADER + COLUMNS)
    f = few.triad("specific_force")
    with h5py.File(folder / "rig.h5", "w") as file:
        file["t"], file["a"] = few.time, f
    scipy.io.savemat(folder / "rig.mat", {"t": few.time, "a": f})
    table = np.column_stack([few.time, f])
    lines = ["t,a[0],a[1],a[2]", *(",".join(f"{x:.8g}" for x in row) for row in table)]
    (folder / "rig.csv").write_text("\n".join(lines) + "\n")
    logged = _log()
    (folder / "log.csv").write_text(_text("timestamp,ax,ay,az,gx,gy,gz", logged))
    (folder / "acc.csv").write_text(_text("time,x,y,z", logged[:, :4]))
    (folder / "gyr.csv").write_text(_text("time,x,y,z", logged[1::2][:, [0, 4, 5, 6]]))
    for k, rows in enumerate((logged[:90], logged[90:170], logged[170:]), start=1):
        (folder / f"part{k}.csv").write_text(_text("time,ax,ay,az", rows[:, :4]))
    (folder / "span.ASC").write_text("".join(map(_increments, logged)))
    (folder / "flight.log").write_text(_messages(logged))
    (folder / "terminal.txt").write_text(
        "".join(
            f"12:{t // 60:02.0f}:{t % 60:06.3f} -> ax: {x[0]:.4f}, ay: {x[1]:.4f}, az: {x[2]:.4f}\n" for t, *x in logged
        )
    )
    still = np.repeat(logged[:, 1:4] * 9.80665, 10, axis=0) + 1e-3 * np.random.default_rng(7).standard_normal((2400, 3))
    turn = np.radians(np.repeat(logged[:, 4:], 10, axis=0))
    (folder / "unit.log").write_text(_text("", np.column_stack([still, turn]), " "))
    for name, columns in (("tk_acc.txt", still), ("tk_gyr.txt", turn)):
        (folder / name).write_text(_text("", np.column_stack([np.arange(2400) * 0.02, columns]), " "))
    rng = np.random.default_rng(1)
    stars = ["a telescope", ":ALTAZ", "35 0 0 2024 1 1 10 900 1000"]
    for i in range(30):
        az, el = rng.uniform(0, 360), rng.uniform(20, 80)
        stars.append(f"{az:.5f} {el:.5f} {az + 0.01:.5f} {el + 0.002 * np.cos(i):.5f}")
    (folder / "stars.dat").write_text("\n".join(stars) + "\nEND\n")
    scope = ["an equatorial one", ":NODA", "35 0 0 2024 1 1 10 900 1000"]
    for i in range(30):
        h, d, lst = rng.uniform(0, 23), rng.uniform(-20, 80), i % 24
        words = f"{int(h):02d} {30:02d} {i:05.2f} {'+' if d > 0 else '-'}{int(abs(d)):02d} {20:02d} {i:04.1f}"
        scope.append(f"{words}  {words}  {lst:02d} {i:04.1f}")
    (folder / "scope.dat").write_text("\n".join(scope) + "\nEND\n")
    telescope = [
        f"CAT: {i}\nRAA: {el:.6f} {az:.6f}\nTAA: {el + 0.001:.6f} {az:.6f}\nLST: {i:02d}:00:00"
        for i, (az, el) in enumerate(rng.uniform(20, 80, (20, 2)))
    ]
    (folder / "telescope.dat").write_text("\n".join(telescope) + "\n")
    (folder / "model.mod").write_text(
        "a mount\nT 30 10.0 0.5\n  IH +10.5 1.0\n  ID -20.1 2.0\n  CH 5 1\n  NP 3 1\nEND\n"
    )
    (folder / "az.mod").write_text(
        "an alt-az mount\nT 30 10.0 0.5\n  IA +10.5 1.0\n  IE -20 2\n  CA 5 1\n  AN 3 1\nEND\n"
    )
    (folder / "guide.txt").write_text(_guide())
    np.savez(folder / "tilt.npz", fs=200.0, **{k: np.zeros(100) for k in ("vel_HHN", "vel_HHE", "vel_HHZ")},
             **{k: np.zeros(100) for k in ("rate_HJN", "rate_HJE", "rate_HJZ")})  # fmt: skip


def _text(head: str, rows: np.ndarray, between: str = ",") -> str:
    return "\n".join(filter(None, [head, *(between.join(f"{x:.6g}" for x in row) for row in rows)])) + "\n"


def _increments(row: np.ndarray) -> str:
    """A row of the log as a receiver of NovAtel writes its counts."""
    t, x, y, z, *turn = row
    counts = [*(60000 * f for f in (z, -y, x)), *(50 * w for w in (turn[2], -turn[1], turn[0]))]
    cells = ",".join(f"{c:.0f}" for c in counts)
    return f"%RAWIMUSA,2387,{500 + t:.3f};2387,{500 + t:.9f},00000077,{cells}*9319b0f1\n"


def _messages(rows: np.ndarray) -> str:
    """The log as a flight controller writes it, other messages between."""
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
             "FMT, 164, 47, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
             "FMT, 151, 43, ATT, Qcc, TimeUS,Roll,Pitch"]  # fmt: skip
    for t, *x in rows:
        gyro, force = np.radians(x[3:]), 9.8 * np.array(x[:3])
        lines.append(f"IMU, {1e6 * t:.0f}, 0, " + ", ".join(f"{v:.6f}" for v in (*gyro, *force)))
        lines.append(f"ATT, {1e6 * t:.0f}, 0.1, 0.2")
    return "\n".join(lines) + "\n"


def _log() -> np.ndarray:
    """A unit in the hand, 8 rests at 5 Hz: time, force in g, rate in deg/s."""
    rng = np.random.default_rng(2)
    rows = []
    faces = [(0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 0, -1), (0, -1, 0), (-1, 0, 0), (0.6, 0.8, 0), (0, 0.6, 0.8)]
    for k, (a, b) in enumerate(zip(faces, faces[1:] + faces[:1], strict=True)):
        rows += [[k * 6 + i * 0.2, *a, 0, 0, 0] for i in range(20)]
        for i in range(10):
            mix = np.array(a) * (1 - i / 10) + np.array(b) * i / 10
            rows.append([k * 6 + 4 + i * 0.2, *mix, 40, 20, 10])
    out = np.array(rows, dtype=float)
    out[:, 1:] += 0.001 * rng.standard_normal(out[:, 1:].shape)
    return out


def _turning() -> Recording:
    """A unit turned in its place: too short for a calibration of 51 states, long enough to be navigated."""
    rng = np.random.default_rng(3)
    n, g = 600, 9.8
    t = np.arange(n) * 0.5
    angle = np.clip((t % 60) - 20, 0, 9) * np.radians(10) + np.floor(t / 60) * np.pi / 2
    rate = np.gradient(angle, t)
    f = np.stack([0 * t, g * np.sin(angle), g * np.cos(angle)])
    level, up = EARTH_RATE * np.cos(0.7), EARTH_RATE * np.sin(0.7)
    w = np.stack([rate, level * np.cos(angle) + up * np.sin(angle), up * np.cos(angle) - level * np.sin(angle)])
    channels = {("specific_force", a): x + 1e-3 * rng.standard_normal(n) for a, x in zip("xyz", f, strict=True)}
    channels |= {("angular_rate", a): x + 1e-6 * rng.standard_normal(n) for a, x in zip("xyz", w, strict=True)}
    hand = read(XSENS)
    site = replace(hand.site, latitude=0.7)
    return replace(hand, kind="rotation", title="turning", site=site, noise={}, time=t, position=None,
                   channels=channels, weight=np.ones(n), units={}, scatter={}, remarks=(), source=())  # fmt: skip


def _stars() -> Recording:
    """A pointing run of an alt-azimuth mount."""
    rng = np.random.default_rng(4)
    n = 40
    el, az = rng.uniform(0.4, 1.3, n), rng.uniform(-3, 3, n)
    noise = 1e-5 * rng.standard_normal((2, n))
    channels = {("gimbal_angle", "elevation"): el, ("gimbal_angle", "azimuth"): az}
    channels |= {("true_angle", "elevation"): el + 3e-4 * np.cos(el) + noise[0],
                 ("true_angle", "azimuth"): az + 1e-4 + noise[1]}  # fmt: skip
    hand = read(XSENS)
    return replace(hand, kind="pointing", title="stars", site=replace(hand.site, latitude=0.6), noise={},
                   time=60.0 * np.arange(n), position=None, channels=channels, weight=np.ones(n), units={},
                   scatter={}, remarks=(), source=(), platform=KNOWN["alt-az"])  # fmt: skip


def _guide() -> str:
    """A guide log of PHD2, one stretch."""
    head = [
        "PHD2 version 2.6.9, Log version 2.5. Log enabled at 2022-12-01 20:00:00", "",
        "Guiding Begins at 2022-12-01 20:00:10",
        "Pixel scale = 1.50 arc-sec/px, Binning = 1, Focal length = 500 mm",
        "RA Guide Speed = 7.5 a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 10.0",
        "Mount = simulator, connected, xAngle = 0.0, xRate = 5.0, yAngle = 90.0, yRate = 5.0",
        "RA = 5.00 hr, Dec = 10.0 deg, Hour angle = -1.00 hr, Pier side = East, Alt = 50.0 deg, Az = 120.0 deg",
        ",".join(NAMES),
    ]  # fmt: skip
    rng = np.random.default_rng(5)
    for i in range(1, 60):
        d = rng.normal(0, 0.3, 2)
        head.append(f'{i},{2 * i:.3f},"Mount",{d[0]:.3f},{d[1]:.3f},{d[0]:.3f},{d[1]:.3f},0.1,0.1,20,W,0,,,,'
                    "1000,30.0,0")  # fmt: skip
    return "\n".join([*head, "Guiding Ends at 2022-12-01 20:03:00", ""])
