"""Write docs/real-recordings.md and its pictures: effects omitted from the model of real recordings and identified.

    python docs/build_real.py FOLDER [--check]

FOLDER holds the files that the page names, one folder a data set (imu_tk_xsens, tilt_table, mmt_pointing,
gem_mount_pointing, mikoff_mpu9150). The page contains only means and misfits of them. The computation takes a minute of
one core. With --check nothing is written, and the exit status is 1 if the page would change.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from build_measured import filled
from chart_sheet import sheet

from gimbalcal.diagnose import Diagnosis, diagnose
from gimbalcal.importers import import_files
from gimbalcal.number import Array
from gimbalcal.recording import Recording, read
from gimbalcal.report.figures import Panel, before_after
from gimbalcal.words.diagnosis_sentences import three_digits
from gimbalcal.words.naming import name_in_words, unit_in_print
from gimbalcal.words.rounding import pdg_rounded

DOCS = Path(__file__).parent
SHIPPED = DOCS.parent / "data" / "space_stable_concealed"
Rows = dict[str, Array]


@dataclass(frozen=True)
class Part:
    """One recording with effects omitted: how it is imported, the baseline, the panels, and the text."""

    title: str
    picture: str
    kind: str
    files: tuple[str, ...]
    baseline: tuple[str, ...]
    about: str
    verdict: str
    panels: Callable[[Part, Path], tuple[Panel, ...]]

    @property
    def command(self) -> str:
        """The commands that reproduce it."""
        name = Path(self.files[0]).stem
        left = f" --baseline {','.join(self.baseline)}" if self.baseline else ""
        return (
            f"gimbalcal import {self.kind} {' '.join(self.files)} --out {name}\n"
            f"gimbalcal diagnose {name}{left} --out {name}-diagnosis"
        )


@cache
def recorded(kind: str, files: tuple[str, ...], data: Path) -> Recording:
    return import_files(kind, [data / f for f in files])


@cache
def diagnosed(kind: str, files: tuple[str, ...], data: Path, baseline: tuple[str, ...]) -> Diagnosis:
    return diagnose([recorded(kind, files, data)], baseline=baseline)


def misfits(part: Part, data: Path, *baseline: str) -> tuple[Rows, Rows, str, Recording]:
    """Misfits by axis before and after, in printed units, and the recording."""
    d = diagnosed(part.kind, part.files, data, baseline or part.baseline)
    noise, c = d.fit["noise"], d.curves
    if c is None:
        raise ValueError("a diagnosis of a recording has curves")
    size = noise["sigma_of_a_row"]
    before, after = ({a: size * r[:, i] for i, (_, a) in enumerate(c.channels)} for r in (c.before, c.after))
    return before, after, unit_in_print(noise["unit"]), recorded(part.kind, part.files, data)


def over_order(part: Part, data: Path) -> tuple[Panel, ...]:
    """Draw the norm of gravity: misalignment omitted and added, then the drift omitted and added."""
    first, _, unit, _ = misfits(part, data)
    second, third, _, _ = misfits(part, data, "bias", "scale_factor", "misalignment")
    x = np.arange(1.0, len(first["norm"]) + 1)
    return (
        Panel("misalignment", unit, x, "position, in order of time", first["norm"], second["norm"]),
        Panel("then the drift", unit, x, "position, in order of time", second["norm"], third["norm"]),
    )


def rates(part: Part, data: Path) -> tuple[Panel, ...]:
    """Draw the rates at rest by position, each axis, in sigma of a mean, since dwells differ in length."""
    d = diagnosed(part.kind, part.files, data, part.baseline)
    before, after, _, _ = misfits(part, data)
    x, s = np.arange(1.0, len(before["x"]) + 1), d.fit["noise"]["sigma_of_a_row"]
    return tuple(Panel(f"rate about {a} at rest", "σ", x, "position", before[a] / s, after[a] / s) for a in "xyz")


def over_time(part: Part, data: Path) -> tuple[Panel, ...]:
    """Draw the tilting table: the force without gravity, and with gravity what lever arm and delay add."""
    first, _, unit, _ = misfits(part, data)
    second, third, _, _ = misfits(part, data, "bias", "gravity_leakage")
    t = np.arange(len(first["x"])) + 0.5
    return (
        Panel("force along x, gravity omitted", unit, t, "time [s]", first["x"], second["x"]),
        Panel("force along x, then lever arm and delay", unit, t, "time [s]", second["x"], third["x"]),
        Panel("force along z, then lever arm and delay", unit, t, "time [s]", second["z"], third["z"]),
    )


def mount(*shown: tuple[str, str, str]) -> Callable[[Part, Path], tuple[Panel, ...]]:
    """Return the panels of a pointing run: channel, abscissa (an axis, or time), and name."""

    def panels(part: Part, data: Path) -> tuple[Panel, ...]:
        before, after, unit, run = misfits(part, data)
        curves = diagnosed(part.kind, part.files, data, part.baseline).curves
        assert curves is not None
        run = run.select(curves.position.astype(int) - 1)  # outliers were omitted
        out = []
        for channel, over, name in shown:
            label = "time [h]" if over == "time" else f"{over.replace('_', ' ')} [deg]"
            x = run.time / 3600 if over == "time" else np.degrees(run.channels["gimbal_angle", over])
            out.append(Panel(name, unit, x, label, before[channel], after[channel]))
        return tuple(out)

    return panels


def clean(part: Part, data: Path) -> tuple[Panel, ...]:
    """Draw misalignment omitted and added, with one sigma of a mean as bars."""
    before, after, unit, _ = misfits(part, data, "bias", "scale_factor")
    d = diagnosed(part.kind, part.files, data, ("bias", "scale_factor"))
    n = len(after["norm"])
    chi2 = d.fit["chi2_of_samples_after"]["norm"]
    sigma = np.full(n, d.fit["rms_after"] / np.sqrt(chi2))
    x = np.arange(1.0, n + 1)
    return (Panel("misalignment, and nothing else", unit, x, "position", before["norm"], after["norm"], sigma),)


XSENS = ("imu_tk_xsens/xsens_acc.mat", "imu_tk_xsens/xsens_gyro.mat")
PARTS = (
    Part(
        "Xsens MTi, accelerometers", "real_xsens_accelerometers.svg", "imu-tk", XSENS, ("bias", "scale_factor"),
        "A real inertial unit turned by hand from dwell to dwell, in nine minutes, outputs in counts. Source: "
        "Tedaldi, Pretto and Menegatti (2014), github.com/Kyle-ak/imu_tk (BSD). No attitude is known; the only "
        "reference is the norm of gravity.",
        "Misalignment is identified first. The remaining misfit depends on the order of the dwells, not on the "
        "attitude: the biases drift, as those of low-cost sensors do. A single step of the biases would fit nearly as "
        "well, which is stated. Quadratic and cubic terms are **not** supported: `gimbalcal calibrate --method "
        "multiposition` omits both, with the reason.",
        over_order,
    ),
    Part(
        "Xsens MTi, gyroscopes", "real_xsens_gyroscopes.svg", "imu-tk", XSENS, ("gyro_bias",),
        "The same recording. Its authors calibrate the gyroscopes by the turns between the dwells and assume a "
        "constant bias at rest.",
        "It is not constant: it depends on the attitude. A matrix of nine coefficients, force to rate, reduces chi^2 "
        "per axis from between 26 and 57 to 2 and less, where the scatter of the samples alone would leave 1. The "
        "matrix was estimated at rest; the turns, which were not used, confirm it: gravity propagated through a turn "
        "deviates much less.",
        rates,
    ),
    Part(
        "Tilting table", "real_tilt_table.svg", "tilt-table", ("tilt_table/tilt_table_200hz.npz",), (),
        "A broadband seismometer (Trillium Compact) and a fibre-optic gyroscope (blueSeis-3A) on a table that is "
        "tilted in steps, 120 s at 200 Hz. Source: Bernauer et al. (2020), data of github.com/solldavid/TwistPy "
        "(LGPL-3). The model assumes that the unit stays level.",
        "Gravity leaks into the horizontal axis (the factor is 1 if both instruments have the gain on their label). "
        "Then the lever arm and a delay between the two instruments are identified, with the azimuth between their y "
        "axes. The experimenters state 0.1045 m for the height of the mass above the hinge (down is positive here) and "
        "0.32 m along the table. The rows are means over one second; the fit uses steps of 10 ms, because the effect "
        "of a lever arm on a mean is the change of rate between the ends of the second.",
        over_time,
    ),
    Part(
        "MMT, 6.5 m telescope", "real_mmt.svg", "mmt", ("mmt_pointing/point_20210821.dat",), (),
        "80 stars in one night, encoder readings against true directions. Source: github.com/MMTObservatory/pytelpoint "
        "(BSD-3). The model contains the zeros of both axes, their nonorthogonality and the collimation.",
        "The base is tilted, the tube bends, and a term in cot(elevation) remains, with the sign opposite to "
        "refraction: part of the correction that was applied for it. The run cannot distinguish the flexure from an "
        "encoder pattern of similar form, which is stated; the tilt it can.",
        mount(
            ("along", "azimuth", "pointing in elevation over azimuth"),
            ("across", "azimuth", "pointing across elevation over azimuth"),
            ("along", "elevation", "pointing in elevation over elevation"),
        ),
    ),
    Part(
        "Amateur mount cgx-l", "real_cgx_l.svg", "tpoint", ("gem_mount_pointing/cgx-l-data.dat",), ("gimbal_zero",),
        "148 stars on both sides of the pier, a German equatorial mount set up for the night. Source: "
        "github.com/gaker/celestial (MIT or Apache-2.0). Everything except the zeros is omitted from the model.",
        "Collimation, nonorthogonality, polar axis, and encoder eccentricity. The remaining misfit has a pattern in "
        "declination that no effect of the catalogue fits: it is reported as unexplained. Inspection suggests "
        "backlash: on one side of the pier (declinations below 50 deg here) the misfit jumps between two values, "
        "mostly with the direction of the last slew; on the other side the imbalance keeps the teeth in contact. A "
        "step of the zero in declination absorbs a part of it, and the stars that are omitted as outliers deviate by "
        "about as much as the backlash.",
        mount(
            ("across", "hour_angle", "pointing across declination over hour angle"),
            ("along", "hour_angle", "pointing in declination over hour angle"),
            ("along", "declination", "pointing in declination over declination"),
        ),
    ),
    Part(
        "Amateur mount warp-astron", "real_warp_astron.svg", "tpoint", ("gem_mount_pointing/warp-astron.dat",), (),
        "98 stars, another mount of the same collection.",
        "Encoder eccentricity, and a zero that drifts steadily in declination: a slipping clutch, or a tube that "
        "settles. Smaller effects follow; causes that these data cannot distinguish are listed together.",
        mount(
            ("along", "time", "pointing in declination over time"),
            ("across", "time", "pointing across declination over time"),
        ),
    ),
    Part(
        "MPU-9150, a clean case", "real_mikoff.svg", "mikoff", ("mikoff_mpu9150/imu0.log",),
        ("bias", "scale_factor", "misalignment"),
        "A low-cost unit turned by hand. Source: github.com/mikoff/imu-calib (MIT).",
        "The accelerometers need no further effect: the residual is explained by the scatter of the samples. The "
        "picture shows misalignment omitted and identified.",
        clean,
    ),
)  # fmt: skip


def step_rows(d: Diagnosis) -> list[str]:
    """Return the misfit after each effect that was identified, in the order of its contribution."""
    fit = d.fit.to_dict()
    unit = unit_in_print(fit["noise"]["unit"])
    rows = ["| model | misfit, rms |", "|---|---|", f"| baseline | {three_digits(fit['rms_before'])} {unit} |"]
    for s in fit["steps"]:
        axis = f" ({s['axis'].replace('_', ' ')})" if s["axis"] else ""
        rows.append(f"| + {name_in_words(s['effect'])}{axis} | {three_digits(s['rms'])} {unit} |")
    if d.unexplained:
        rows.append(f"| + a shape without a cause | {three_digits(fit['rms_after'])} {unit} |")
    outside = f"{three_digits(fit['heldout_rms_before'])} → {three_digits(fit['heldout_rms_after'])} {unit}"
    rows.append(f"| held-out data, before → after | {outside} |")
    if "chi2_of_samples_after" in fit:
        b, a = (", ".join(three_digits(x) for x in fit[f"chi2_of_samples_{w}"].values()) for w in ("before", "after"))
        rows.append(f"| chi² per degree of freedom, samples' scatter as noise | {b} → {a} |")
    if "turns" in fit:
        t = fit["turns"]
        rows.append(f"| gravity missed after a turn, rms | {t['rms_before']:.0f} → {t['rms_after']:.0f} {t['unit']} |")
    return rows


def size_rows(d: Diagnosis) -> list[str]:
    """Return the effects with size, one sigma, probability and what they are confounded with."""
    rows = ["", "| effect | probability (at most 90 %) | size ± 1σ | confounded with |", "|---|---|---|---|"]
    for f in d.findings:
        sizes = "<br>".join(_size(p) for p in f["parameters"])
        axis = f" ({f['axis'].replace('_', ' ')})" if f["axis"] else ""
        twins = ", ".join(name_in_words(t) for t in f["twins"]) or "–"
        rows.append(f"| {name_in_words(f['effect'])}{axis} | {100 * f['probability']:.3g} % | {sizes} | {twins} |")
    return rows if d.findings else []


def _size(p: dict[str, Any]) -> str:
    value, sigma = pdg_rounded(p["value"], p["sigma"])
    unit = unit_in_print(p["unit"]) if p["unit"] != "1" else ""
    return f"{p['name'].replace('_', ' ')} {p['axis'].replace('_', ' ')} {value} ± {sigma} {unit}".replace("  ", " ")


def section(part: Part, data: Path, draw: bool) -> str:
    """Return the section of one recording."""
    d = diagnosed(part.kind, part.files, data, part.baseline)
    if draw:
        save(part.picture, part.panels(part, data))
    lines = [f"## {part.title}", "", part.about, "", part.verdict, "", f"![{part.title}](pictures/{part.picture})", "",
             f"> {d.in_words}", "", *step_rows(d), *size_rows(d), "", "```", part.command, "```", ""]  # fmt: skip
    return "\n".join(lines)


def save(name: str, panels: Sequence[Panel]) -> None:
    """A picture as SVG, the same bytes for the same numbers."""
    (DOCS / "pictures").mkdir(exist_ok=True)
    (DOCS / "pictures" / name).write_text(sheet(before_after(panels)), encoding="utf-8")


def concealed(draw: bool) -> str:
    """The thermometer hidden and given back."""
    recording = read(SHIPPED)
    hidden = replace(recording, channels={k: c for k, c in recording.channels.items() if k[0] != "temperature"})
    blind, seen = diagnose([hidden]), diagnose([recording])
    c = seen.curves
    if c is None:
        raise ValueError("a diagnosis of a recording has curves")
    i = c.channels.index(("specific_force", "y"))
    groups = np.array_split(np.arange(len(c.time)), 90)
    t, before, after = (np.array([x[g].mean() for g in groups]) for x in (c.time, c.before[:, i], c.after[:, i]))
    T = np.array([recording.channels["temperature", ""][g].mean() for g in groups])
    panels = (
        Panel("force along y, without and with the thermometer", "σ", t / 3600, "time [h]", before, after),
        Panel("the same over the hidden channel", "σ", T, "temperature [°C]", before, after),
    )  # fmt: skip
    if draw:
        save("real_concealed_channel.svg", panels)
    return f"""## A hidden channel

`data/space_stable_concealed` is a simulated recording of 18 positions that ships with the project, in which the bias of
one accelerometer depends on the temperature. Without the `temperature` column in its `recording.toml` no effect of the
catalogue can explain it, and the verdict says so: **{blind.verdict}**.

> {blind.in_words}

With the column the verdict is **{seen.verdict}**.

> {seen.in_words}

![A hidden channel](pictures/real_concealed_channel.svg)
"""


HEAD = """# Real recordings

Effects are omitted from the model of a real recording, and the diagnosis has to identify them. This page is written by
`python docs/build_real.py FOLDER`; the raw files are not part of the project. `tests/real` asserts the results where
the files are present, and is skipped otherwise.

None of these recordings states its noise. The scale of the noise and its correlation in time are integrated over, and
misfits are given in their own units. *Held-out data* are rows that were omitted from the fit one by one, or ten
seconds at a time for the table. The panels show the misfit before (grey) and after (blue).
"""


VERDICTS = ("right", "half right", "honest refusal", "refused", "false green", "wrong", "crash")

UNSEEN = """
## Recordings of other repositories

COUNT recordings, seven of them simulated, taken from public repositories after the program was written. Each was
examined independently in plain numpy and then run through `new`, `calibrate`, `diagnose` or `noise` as a user would.
The first run is that of the program as it was, the last run that after what it showed had been corrected.

FIRST_RUNS

The verdicts compare a run with the independent fit, by hand:

* *right*: as the independent fit;
* *half right*: usable after a correction by the user, or with one wrong statement;
* *honest refusal*: refused for the true reason, or for a *false reason* where that is added; *refused*:
  the recording is usable, or the reason is not the true one;
* *false green*: called adequate where the independent fit denies it;
* *wrong*: any other false statement, *silently* if no message pointed to it; *crash*: a defect of the program;
* *not repeated*: first run only.

The recordings are not part of the project.

<!-- measured: unseen_recordings -->
<!-- end of unseen_recordings -->
"""


def first_runs(rows: Sequence[str]) -> str:
    """Return a table of how many first runs are of each verdict, from the rows of the recordings."""
    verdicts = [row.split(" | ")[2] for row in rows]
    counts = Counter(next(v for v in VERDICTS if words.startswith(v)) for words in verdicts)
    silently = sum(words.startswith("wrong, silently") for words in verdicts)
    false_reason = sum("false reason" in words for words in verdicts)
    lines = [f"| {v} | {counts[v]} |" for v in VERDICTS]
    return "\n".join([
        "| first run | recordings |", "|---|---|", *lines, "",
        f"{silently} of the wrong runs are silent; {false_reason} recordings are refused for a false reason.",
    ])  # fmt: skip


def unseen() -> str:
    """Return the section on recordings of other repositories, with their number and the verdicts on first runs."""
    section = filled(UNSEEN)
    rows = [line for line in section.splitlines() if line.startswith("| ")][1:]  # below the names of the columns
    return section.replace("COUNT", str(len(rows))).replace("FIRST_RUNS", first_runs(rows))


def main(folder: str, check: bool) -> int:
    """Write the page, or compare it with the present results: 1 if they differ."""
    data, place = Path(folder), DOCS / "real-recordings.md"
    parts = [section(p, data, draw=not check) for p in PARTS]
    now = "\n".join([HEAD, *parts, concealed(draw=not check), unseen()])
    if check:
        return int(place.read_text(encoding="utf-8") != now)
    place.write_text(now, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], "--check" in sys.argv))
