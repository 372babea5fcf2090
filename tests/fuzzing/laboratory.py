"""What a laboratory has: recordings of every kind, a log in every documented format, and files of other programs.

Written from README, docs and the contract of files alone, with a plant of its own: gravity through a chain of gimbals,
turns of a unit in the hand, a rate table, stars on a mount. Only `data/space_stable_static` is a file that ships.
"""

import json
import shutil
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import scipy.io
from scipy.spatial.transform import Rotation

from tests.paths import DATA

Rng = np.random.Generator
Header, Rows = dict[str, Any], dict[str, np.ndarray]
G, OMEGA, LATITUDE = 9.80146, np.radians(15.041067 / 3600), np.radians(40.0)
GIMBALS = ("platform", "inner", "middle")
SI = {"m/s^2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "Gal": 1e-2, "rad": 1.0, "deg": np.pi / 180, "s": 1.0, "": 1.0,
      "arcmin": np.pi / 10800, "mrad": 1e-3, "rev": 2 * np.pi, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0,
      "rad/s": 1.0, "deg/s": np.pi / 180, "degC": 1.0, "arcsec": np.pi / 648000}  # fmt: skip


def turn(axis: str, a: np.ndarray) -> np.ndarray:
    """Frame rotation about an axis (n, 3, 3)."""
    return np.asarray(Rotation.from_euler(axis, a[:, None]).inv().as_matrix())


def number(value: float, unit: str) -> dict[str, Any]:
    """A number with its unit."""
    return {"value": value, "unit": unit}


def columns(**named: tuple[str, str, str]) -> dict[str, Any]:
    """[columns], of (quantity, axis, unit)."""
    return {
        name: {k: v for k, v in zip(("quantity", "axis", "unit"), each, strict=True) if v}
        for name, each in named.items()
    }


def triad(letter: str, quantity: str, unit: str) -> dict[str, tuple[str, str, str]]:
    """Columns x, y, z of a sensor."""
    return {f"{letter}{x}": (quantity, x, unit) for x in "xyz"}


def described(kind: str, title: str, platform: str, site: Header, /, **named: tuple[str, str, str]) -> Header:
    """A header; the clock is `time_s`."""
    return {"format": 1, "kind": kind, "title": title, "samples": "samples.csv", "site": site,
            "platform": {"name": platform}, "columns": columns(time_s=("time", "", "s"), **named)}  # fmt: skip


# --- recordings ---------------------------------------------------------------------------------------------------


def rig(rng: Rng) -> tuple[Header, Rows]:
    """A space-stable platform in 18 positions: g^p = Rz(platform) Rx(inner) Ry(middle) (0, 0, g), force = -g."""
    degrees = [
        (p, i, m) for p in (0.0, 45.0, 90.0) for i, m in ((0, 0), (90, 0), (0, 90), (180, 45), (-90, 45), (45, -90))
    ]
    angles = np.radians(np.repeat(np.array(degrees), 6, axis=0))
    C = turn("z", angles[:, 0]) @ turn("x", angles[:, 1]) @ turn("y", angles[:, 2])
    force = -C @ np.array([0.0, 0.0, G])
    read = force * (1 + np.array([2e-4, -1e-4, 3e-4])) + np.array([1e-3, -2e-3, 5e-4])
    read += 1e-4 * rng.standard_normal(read.shape)
    site = {"latitude": number(40.0, "deg"), "gravity": number(G, "m/s^2")}
    header = described("multi-position", "rig", "space-stable", site,
                       position=("position", "", ""), **triad("a", "specific_force", "m/s^2"),
                       **{n: ("gimbal_angle", n, "deg") for n in GIMBALS})  # fmt: skip
    header["noise"] = {"accelerometer": number(1e-4, "m/s^2"), "gimbal_angle": number(1.0, "arcsec")}
    rows = {"time_s": 10.0 * np.arange(len(read)), "position": np.repeat(np.arange(1.0, 19.0), 6)}
    rows |= {f"a{x}": read[:, i] for i, x in enumerate("xyz")}
    return header, rows | {n: np.degrees(angles[:, i]) for i, n in enumerate(GIMBALS)}


def hand(rng: Rng) -> tuple[Header, Rows]:
    """A unit laid down in 24 attitudes; no angles."""
    down = rng.standard_normal((24, 3))
    down /= np.linalg.norm(down, axis=1)[:, None]
    force = np.repeat(-G * down, 12, axis=0) * 1.001 + 0.02 + 5e-3 * rng.standard_normal((288, 3))
    header = described("multi-position", "hand", "bench", {"gravity": number(G, "m/s^2")},
                       position=("position", "", ""), **triad("a", "specific_force", "m/s^2"))  # fmt: skip
    rows = {"time_s": 1.0 * np.arange(288), "position": np.repeat(np.arange(1.0, 25.0), 12)}
    return header, rows | {f"a{x}": force[:, i] for i, x in enumerate("xyz")}


def stars(rng: Rng) -> tuple[Header, Rows]:
    """An alt-azimuth mount with an encoder zero and a collimation."""
    el, az = np.degrees(rng.uniform(0.4, 1.2, 40)), np.degrees(rng.uniform(-3, 3, 40))
    noise = 0.002 * rng.standard_normal((2, 40))
    header = described("pointing", "stars", "alt-az", {"latitude": number(40.0, "deg")},
                       **{f"{q[0]}_{x}": (q, x, "deg") for q in ("gimbal_angle", "true_angle")
                          for x in ("elevation", "azimuth")})  # fmt: skip
    true = {"t_elevation": el + 0.05 + noise[0], "t_azimuth": az + 0.1 + 0.02 / np.cos(np.radians(el)) + noise[1]}
    return header, {"time_s": 60.0 * np.arange(40), "g_elevation": el, "g_azimuth": az} | true


def static(_: Rng) -> tuple[Header, Rows]:
    """The first hours of the static run that ships."""
    header = tomllib.loads((DATA / "space_stable_static" / "recording.toml").read_text())
    rows = pl.read_csv(DATA / "space_stable_static" / "samples.csv", comment_prefix="#").head(240).to_dict()
    return header | {"samples": "samples.csv"}, {name: x.to_numpy().astype(float) for name, x in rows.items()}


def table(rng: Rng, axis: int = 2) -> tuple[Header, Rows]:
    """Gyroscopes on a rate table that turns one of their axes at steady rates, both ways."""
    rates = np.repeat([0.0, 20, 0, 60, 0, -20, 0, -60, 0, 120, 0, -120, 0], 50)
    t = 0.1 * np.arange(len(rates))
    angle = np.concatenate([[0.0], np.cumsum(0.05 * (rates[1:] + rates[:-1]))])
    read = np.outer(np.gradient(angle, t), np.eye(3)[axis] * (1 + 5e-4) + 1e-3) + np.array([0.02, -0.01, 0.03])
    read += 0.01 * rng.standard_normal(read.shape)
    header = described("rotation", f"table {'xyz'[axis]}", "rate table", {"latitude": number(40.0, "deg")},
                       angle=("gimbal_angle", "table", "deg"), **triad("w", "angular_rate", "deg/s"))  # fmt: skip
    header["platform"]["axes"] = [{"name": "table", "direction": "xyz"[axis]}]
    return header, {"time_s": t, "angle": angle} | {f"w{x}": read[:, i] for i, x in enumerate("xyz")}


def reversed_(rng: Rng) -> tuple[Header, Rows]:
    """Gyroscopes at rest on a level, turned by half a turn."""
    north = OMEGA * np.cos(LATITUDE) * np.repeat([1.0, -1.0], 300)
    rate = np.column_stack([north, 0 * north, np.full(600, -OMEGA * np.sin(LATITUDE))]) + 1e-5
    rate += 1e-6 * rng.standard_normal(rate.shape)
    header = described("multi-position", "reversed", "rate-table", {"latitude": number(40.0, "deg")},
                       position=("position", "", ""), angle=("gimbal_angle", "table", "deg"),
                       **triad("w", "angular_rate", "rad/s"))  # fmt: skip
    rows = {
        "time_s": 1.0 * np.arange(600),
        "position": np.repeat([1.0, 2.0], 300),
        "angle": np.repeat([0.0, 180.0], 300),
    }
    return header, rows | {f"w{x}": rate[:, i] for i, x in enumerate("xyz")}


def moving(rng: Rng) -> tuple[Header, Rows]:
    """Gyroscopes that are waved about, and their attitude by a camera."""
    t = 0.02 * np.arange(1500)
    rate = np.stack([np.sin(1.3 * t), np.cos(0.9 * t), 0.8 * np.sin(0.7 * t + 1)], axis=1)
    at = [Rotation.identity()]
    for w in 0.5 * (rate[1:] + rate[:-1]):
        at.append(at[-1] * Rotation.from_rotvec(0.02 * w))
    q = np.array([r.as_quat() for r in at])
    read = rate * 1.002 + 0.01 + 1e-3 * rng.standard_normal(rate.shape)
    header = described("rotation", "moving", "bench", {"latitude": number(40.0, "deg")},
                       **triad("w", "angular_rate", "rad/s"),
                       **{f"q{x}": ("attitude", f"q{x}", "1") for x in "wxyz"})  # fmt: skip
    rows = {"time_s": t} | {f"w{x}": read[:, i] for i, x in enumerate("xyz")}
    return header, rows | {f"q{x}": q[:, i] for x, i in zip("wxyz", (3, 0, 1, 2), strict=True)}


def turning(rng: Rng) -> tuple[Header, Rows]:
    """A unit that is turned about x in its place, with dwells between."""
    t = 0.5 * np.arange(600)
    a = np.clip((t % 60) - 20, 0, 9) * np.radians(10) + np.floor(t / 60) * np.pi / 2
    north, down = OMEGA * np.cos(LATITUDE), -OMEGA * np.sin(LATITUDE)
    rate = np.column_stack([np.gradient(a, t) + north, down * np.sin(a), down * np.cos(a)])
    force = -G * np.column_stack([0 * a, np.sin(a), np.cos(a)]) + 1e-3 * rng.standard_normal((600, 3))
    rate += 1e-6 * rng.standard_normal(rate.shape)
    header = described("rotation", "turning", "bench", {"latitude": number(40.0, "deg")},
                       **triad("a", "specific_force", "m/s^2"), **triad("w", "angular_rate", "rad/s"))  # fmt: skip
    rows = {"time_s": t} | {f"a{x}": force[:, i] for i, x in enumerate("xyz")}
    return header, rows | {f"w{x}": rate[:, i] for i, x in enumerate("xyz")}


PLANTS: dict[str, Callable[[Rng], tuple[Header, Rows]]] = {
    "rig": rig, "hand": hand, "stars": stars, "static": static, "reversed": reversed_, "moving": moving,
    "tx": lambda r: table(r, 0), "ty": lambda r: table(r, 1), "tz": table, "turning": turning,
}  # fmt: skip


def toml(value: Any) -> str:
    """A value of TOML; JSON is one but for tables and null."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return "nan"
    return json.dumps(value, ensure_ascii=False, default=str).replace("\x7f", "\\u007f").replace("Infinity", "inf")


def save(folder: Path, header: Header, rows: Rows) -> None:
    """A recording folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.toml").write_text("".join(f"{json.dumps(k)} = {toml(v)}\n" for k, v in header.items()))
    frame = pl.DataFrame({name: pl.Series(x) for name, x in rows.items()})
    if str(header["samples"]).endswith(".parquet"):
        frame.write_parquet(folder / "samples.parquet")
    else:
        frame.write_csv(folder / "samples.csv")


def load(folder: Path) -> Rows:
    """Columns of a recording folder by quantity and axis, SI."""
    header = tomllib.loads((folder / "recording.toml").read_text())
    parquet = (folder / "samples.parquet").is_file()
    frame = (
        pl.read_parquet(folder / "samples.parquet")
        if parquet
        else pl.read_csv(folder / "samples.csv", comment_prefix="#")
    )
    found = {}
    for name, column in header["columns"].items():
        scale = SI.get(column.get("unit", ""), 1.0) * column.get("sign", 1)
        found[f"{column['quantity']}:{column.get('axis', '')}"] = scale * frame[name].cast(pl.Float64).to_numpy()
    return found


# --- logs ---------------------------------------------------------------------------------------------------------

LOG = ("t", *(f"a{x}" for x in "xyz"), *(f"g{x}" for x in "xyz"))


def log_of(rng: Rng) -> np.ndarray:
    """A unit that is turned from dwell to dwell by hand at 20 Hz: time, force [m/s^2], rate [rad/s]."""
    steps = [
        ("x", 90),
        ("x", 90),
        ("x", 90),
        ("y", 90),
        ("x", 90),
        ("y", 180),
        ("z", 45),
        ("x", 45),
        ("y", 45),
        ("x", 60),
    ]
    at, force, rate = Rotation.identity(), [], []
    for axis, degrees in [("x", 0), *steps]:
        u, a = np.eye(3)["xyz".index(axis)], np.radians(degrees)
        for k in range(50):
            moved = k < 20
            at = at * Rotation.from_rotvec(u * a / 20) if moved else at
            force.append(at.inv().apply([0.0, 0.0, -G]))
            rate.append(u * a if moved else np.zeros(3))
    f, w = np.array(force) * 1.002 + 0.05, np.array(rate) + 0.004
    noise = rng.standard_normal((len(f), 6)) * np.repeat([5e-3, 1e-3], 3)
    return np.round(np.column_stack([0.05 * np.arange(len(f)), np.column_stack([f, w]) + noise]), 6)


def lines(rows: np.ndarray, mark: str) -> str:
    """Rows of text."""
    return "".join(mark.join(f"{x:.9g}" for x in row) + "\n" for row in rows)


def _json_line(row: np.ndarray) -> str:
    return json.dumps(dict(zip(LOG, row.tolist(), strict=True))) + "\n"


MESSAGES = "FMT, 164, 47, IMU, Qffffff, t,ax,ay,az,gx,gy,gz\nFMT, 151, 43, GPS, QB, t,fix\n"


def _terminal_line(row: np.ndarray) -> str:
    cells = ", ".join(f"{k}: {v:.6f}" for k, v in zip(LOG[1:], row[1:], strict=True))
    return f"12:{row[0] // 60:02.0f}:{row[0] % 60:06.3f} -> {cells}\n"


def write_log(path: Path, x: np.ndarray) -> None:
    """The log in the format of its name."""
    named = dict(zip(LOG, x.T, strict=True))
    heading = ["time [s]", *(f"acc_{k} [m/s^2]" for k in "xyz"), *(f"gyr_{k} [rad/s]" for k in "xyz")]
    texts: dict[str, Callable[[], str]] = {
        "log.csv": lambda: ",".join(heading) + "\n" + lines(x, ","),
        "semicolon.csv": lambda: ";".join(heading) + "\n" + lines(x, ";").replace(".", ","),
        "tab.txt": lambda: "% " + "\t".join(heading) + "\n" + lines(x, "\t"),
        "two_lines.txt": lambda: "time,acc,,,gyr,,\n,x,y,z,x,y,z\n" + lines(x, ","),
        "utf16.csv": lambda: ",".join(heading) + "\n" + lines(x, ","),
        "lines.jsonl": lambda: "".join(map(_json_line, x)),
        "whole.json": lambda: json.dumps({k: v.tolist() for k, v in named.items()}),
        "kinds.txt": lambda: MESSAGES + "".join(f"IMU,{lines(row[None], ',')}GPS,{row[0]:.6g},2\n" for row in x),
        "terminal.txt": lambda: "".join(map(_terminal_line, x)),
    }  # fmt: skip
    if path.name in texts:
        path.write_text(texts[path.name](), encoding="utf-16" if "utf16" in path.name else "utf-8")
    elif path.suffix == ".mat":
        scipy.io.savemat(path, {"t": x[:, 0], "acc": x[:, 1:4], "gyr": x[:, 4:]})
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["t"], file["acc"], file["gyr"] = x[:, 0], x[:, 1:4], x[:, 4:]
    elif path.suffix == ".npz":
        np.savez(path, t=x[:, 0], acc=x[:, 1:4], gyr=x[:, 4:])
    elif path.suffix == ".npy":
        np.save(path, x)
    elif path.suffix == ".parquet":
        pl.DataFrame(named).write_parquet(path)
    else:
        path.write_bytes(x.astype("<f8").tobytes())


LOGS = ("log.csv", "semicolon.csv", "tab.txt", "two_lines.txt", "utf16.csv", "lines.jsonl", "whole.json", "kinds.txt",
        "terminal.txt", "log.mat", "log.h5", "log.npz", "log.npy", "log.parquet", "log.bin")  # fmt: skip


def guide_log(rng: Rng) -> str:
    """A guide log of PHD2: offsets of a star in pixels and the pulses that were sent, one stretch."""
    text = """PHD2 version 2.6.9, Log version 2.5. Log enabled at 2022-12-01 20:00:00

Guiding Begins at 2022-12-01 20:00:10
Pixel scale = 1.50 arc-sec/px, Binning = 1, Focal length = 500 mm
RA Guide Speed = 7.5 a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 10.0
Mount = simulator, connected, xAngle = 0.0, xRate = 5.0, yAngle = 90.0, yRate = 5.0
RA = 5.00 hr, Dec = 10.0 deg, Hour angle = -1.00 hr, Pier side = East, Alt = 50.0 deg, Az = 120.0 deg
"""
    names = (
        "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection",
        "DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode\n",
    )
    rows = []
    for i in range(1, 200):
        x, y = np.sin(0.2 * i) + 0.1 * rng.standard_normal(), 0.1 * rng.standard_normal()
        rows.append(f'{i},{2 * i:.3f},"Mount",{x:.3f},{y:.3f},{x:.3f},{y:.3f},0.1,0.1,20,W,0,,,,1000,30.0,0\n')
    return text + ",".join(names) + "".join(rows) + "Guiding Ends at 2022-12-01 20:07:00\n"


def equatorial(rng: Rng) -> str:
    """Observations of an equatorial mount: catalogue and reported place, sidereal time."""

    def sexagesimal(x: float) -> str:
        seconds = round(abs(x) * 36000) / 10
        return f"{'-' if x < 0 else ''}{seconds // 3600:02.0f} {seconds % 3600 // 60:02.0f} {seconds % 60:04.1f}"

    text = "scope\n:EQUAT\n35 0 0 2024 1 1 10 900 1000\n"
    for i, (ha, dec) in enumerate(rng.uniform((-4, -20), (4, 70), (30, 2))):
        lst = 6 + 0.3 * i
        ra = (lst - ha) % 24
        places = f"{sexagesimal(ra)} {sexagesimal(dec)}  {sexagesimal(ra + 0.003)} {sexagesimal(dec + 0.02)}"
        text += f"{places}  {int(lst + 1e-6):02d} {(lst + 1e-6) % 1 * 60:04.1f}\n"
    return text + "END\n"


def files(folder: Path, rng: Rng) -> None:
    """Logs and files of other programs."""
    log = log_of(rng)
    for name in LOGS:
        write_log(folder / name, log)
    for k, (i, j) in enumerate(((0, 150), (150, 300), (300, len(log))), start=1):
        (folder / f"part{k}.csv").write_text(",".join(LOG) + "\n" + lines(log[i:j], ","))
    named = {"time [s]": ("time", "", "s"), **{f"acc_{x} [m/s^2]": ("specific_force", x, "m/s^2") for x in "xyz"}}
    for name, quantities in (("header.toml", named), ("mat.toml", _by_index("{}")), ("h5.toml", _by_index("/{}"))):
        entries = "".join(f"{json.dumps(n)} = {toml(v)}\n" for n, v in columns(**quantities).items())
        (folder / name).write_text(
            'format = 1\nkind = "multi-position"\n[platform]\nname = "bench"\n[columns]\n' + entries
        )
    (folder / "unit.log").write_text(lines(log[:, 1:], " "))
    for name, x in (("acc.txt", log[:, :4]), ("gyr.txt", log[:, [0, 4, 5, 6]])):
        (folder / name).write_text(lines(x, " "))
    _, sky = stars(rng)
    angles = [sky[k] % 360 for k in ("t_azimuth", "t_elevation", "g_azimuth", "g_elevation")]
    sighted = np.column_stack(angles)
    (folder / "stars.dat").write_text(f"stars\n:ALTAZ\n35 0 0 2024 1 1 10 900 1000\n{lines(sighted, ' ')}END\n")
    (folder / "scope.dat").write_text(equatorial(rng))
    (folder / "stars.csv").write_text("target_az,target_el,enc_az,enc_el\n" + lines(sighted, ","))
    (folder / "telescope.dat").write_text("".join(
        f"CAT: {i}\nRAA: {re:.6f} {ra:.6f}\nTAA: {te:.6f} {ta:.6f}\nLST: {i % 24:02d}:00:00\n"
        for i, (ta, te, ra, re) in enumerate(sighted)))  # fmt: skip
    (folder / "guide.txt").write_text(guide_log(rng))
    still = 1e-6 * rng.standard_normal((6, 400))
    names = [f"{p}{x}" for p in ("vel_HH", "rate_HJ") for x in "NEZ"]
    np.savez(folder / "tilt.npz", fs=20.0, **dict(zip(names, still, strict=True)))
    (folder / "mount.mod").write_text("a mount\nT 30 10.0 0.5\n  IA +10.5 1.0\n  IE -20 2\n  CA 5 1\n  AN 3 1\nEND\n")
    scenario = {"format": 1, "kind": "multi-position", "seed": 3, "site": {"latitude": number(40.0, "deg")},
                "schedule": {"name": "wu2018-18", "dwell": number(10.0, "min"), "rate": number(0.01, "Hz")},
                "noise": {"accelerometer": number(10.0, "ug"), "gimbal_angle": number(1.0, "arcsec")},
                "truth": {"bias": {"x": 150.0}}}  # fmt: skip
    (folder / "scenario.toml").write_text("".join(f"{k} = {toml(v)}\n" for k, v in scenario.items()))
    holds = [{"inner": 90.0 * k, "middle": 45.0 * j} for k in range(4) for j in range(3)]
    plan = toml({"dwell": number(60.0, "s"), "holds": holds})
    (folder / "schedule.toml").write_text(f'format = 1\nplatform = {{ name = "space-stable" }}\nschedule = {plan}\n')
    (folder / "law.py").write_text(LAW)


def _by_index(path: str) -> dict[str, tuple[str, str, str]]:
    force = {path.format(f"acc[{i}]"): ("specific_force", x, "m/s^2") for i, x in enumerate("xyz")}
    return {path.format("t"): ("time", "", "s"), **force}


LAW = '''"""An effect of one's own."""
from gimbalcal.effects.effect import TRIAD, Effect, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array


@effect
class SideForce(Effect):
    r"""The output follows the force times its cube across.

    .. math:: \\\\delta a_i = w_i f_x f_y^3
    """

    id = "side_force"
    stage = Stage.ACCELEROMETER
    w: Array = parameter(TRIAD, unit="ug/g^4", sigma=50, name="side force")

    def contribution(self, s: Stimulus) -> Array:
        return self.w * (s.force[:, 0] * s.force[:, 1] ** 3)[..., None]
'''


def laboratory(folder: Path, calibrate: Callable[[Sequence[str]], None]) -> None:
    """Every seed into `folder`; `calibrate` runs the command of these arguments there."""
    rng = np.random.default_rng(8)
    for name, plant in PLANTS.items():
        save(folder / name, *plant(rng))
    files(folder, rng)
    for k in range(2):
        save(folder / "mounts" / f"mount{k}", *stars(rng))
    for name in ("rig", "stars"):
        calibrate(["calibrate", name, "--out", "made"])
        shutil.copy(folder / "made" / "calibration.json", folder / f"{name}.json")
        shutil.rmtree(folder / "made")
    for k in range(1, 7):
        content = json.loads((folder / "rig.json").read_text())
        content["provenance"]["created"] = f"2026-0{k}-01T12:00:00+00:00"
        content["provenance"]["recordings"] = [{"path": f"{k}", "sha256": f"{k}" * 64}]
        (folder / f"month{k}.json").write_text(json.dumps(content))
        save(folder / "unit", *rig(rng))
        calibrate(["calibrate", "unit", "--store", "fleet.sqlite", "--unit", f"u{k % 5}", "--out", "made"])
        shutil.rmtree(folder / "made")
    for kind, of in (("kalibr", "rig"), ("psins", "rig"), ("csv", "rig"), ("tpoint", "stars")):
        calibrate(["export", kind, "--calibration", f"{of}.json", "--out", "."])
