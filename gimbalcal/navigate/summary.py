"""Content of navigation.json, and its sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.earth import HOUR, NAUTICAL_MILE
from gimbalcal.entries import Entry, Json
from gimbalcal.navigate.navigation_errors import CHANNELS, NONE, Navigated
from gimbalcal.navigate.space_stable_navigator import Aids
from gimbalcal.number import Array
from gimbalcal.recording import Source
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_SERIES_ROWS = 1000
_DRAWN = (("position", "n mile"), *CHANNELS)  # what a figure and `series` have


@dataclass(frozen=True)
class ChannelError:
    """Errors of one channel of a run in `unit`, navigator minus true.

    improvement_percent: of the largest error over that of the first run, None for the first; sigma_linear and
    sigma_sampled: the largest one sigma that the calibration's covariance leaves.
    """

    name: str
    unit: str
    calibration: str
    max: float
    rms: float
    improvement_percent: float | None
    drift_per_day: float
    sigma_linear: float | None
    sigma_sampled: float | None


@dataclass(frozen=True)
class PositionError:
    """Errors of the horizontal position of a run [n mile]."""

    calibration: str
    max_nmi: float
    rms_nmi: float
    end_nmi: float
    improvement_percent: float | None


@dataclass(frozen=True)
class NamedCalibration(Entry):
    """A calibration by which a recording was navigated: its name in the results, and its file."""

    name: str
    path: str


@dataclass(frozen=True)
class NavigationInputs(Entry):
    """The recording, the calibrations, and how many sampled calibrations with which seed give the sampled sigma."""

    recordings: tuple[Source, ...] = ()
    calibrations: tuple[NamedCalibration, ...] = ()
    samples: int | None = None
    seed: int | None = None


@dataclass(frozen=True, repr=False)
class NavigationSummary(Displayed):
    """What navigations of one recording differ by from the truth; the others are compared with the first run."""

    hours: float
    mechanisation: str
    damping: float | None
    alignment_s: float
    channels: tuple[ChannelError, ...]
    position: tuple[PositionError, ...]
    provenance: NavigationInputs
    title: str = ""
    runs: tuple[Navigated, ...] = field(default=(), compare=False)

    def __str__(self) -> str:
        """Return the answer as the console has it."""
        from gimbalcal.words.answers import navigation_answer

        return navigation_answer(self)

    def plot(self) -> Figure:
        """Return a matplotlib figure of the errors over time: position and every channel, without and with."""
        figure, axes = panels([f"{name} [{unit}]" for name, unit in _DRAWN])
        for i, ax in enumerate(axes):
            for run in self.runs:
                ax.plot(run.time / HOUR, _drawn_errors(run, i), lw=1, label=run.label)
            ax.set_xlabel("time [h]", fontsize=8)
        axes[0].legend(fontsize=7)
        return figure

    def to_frame(self, kind: str = "polars") -> Any:
        """Return the errors over time: time_s, and `<channel>` of each run, with a band; "polars" or "pandas"."""
        return data_frame(self.series, kind)

    @property
    def series(self) -> dict[str, list[float]]:
        """Errors over time, in the units of the channels and position in n mile, in at most `MAX_SERIES_ROWS` rows.

        A channel of the last run, that with the last calibration, has its name alone; of another run also its label.
        """
        if not self.runs:
            return {}
        time = self.runs[-1].time
        rows = np.unique(np.linspace(0, len(time) - 1, MAX_SERIES_ROWS).astype(int))
        out = {"time_s": time[rows].tolist()}
        for run in reversed(self.runs):
            for i, (name, _) in enumerate(_DRAWN):
                key = name if run is self.runs[-1] else f"{name}, {run.label}"
                values = _drawn_errors(run, i)[rows]
                if np.all(np.isfinite(values)):
                    out[key] = values.tolist()
        return out

    @property
    def increased(self) -> bool:
        """Return whether a calibration increases the position error."""
        first, *others = self.position
        return any(p.max_nmi > first.max_nmi for p in others)

    @property
    def in_words(self) -> str:
        """The largest position error of each run, in one sentence."""
        errors = [
            f"{p.max_nmi:.3g} n mile {'without calibration' if p.calibration == NONE else f'with {p.calibration}'}"
            for p in self.position
        ]
        both = " and ".join(filter(None, [", ".join(errors[:-1]), errors[-1]]))
        return f"in {self.hours:.3g} h the position is wrong by at most {both}"

    def to_dict(self) -> Json:
        """Return the content of navigation.json."""
        return {
            "format": 1,
            "hours": self.hours,
            "mechanisation": self.mechanisation,
            "damping": self.damping,
            "alignment_s": self.alignment_s,
            "channels": [asdict(c) for c in self.channels],
            "position": [asdict(p) for p in self.position],
            "provenance": self.provenance.to_dict(),
            "in_words": self.in_words,
            "series": self.series,
        }


def summary(runs: Sequence[Navigated], aids: Aids, provenance: NavigationInputs, title: str = "") -> NavigationSummary:
    """Return how far navigations are off, by channel and in position, and what each calibration improves.

    title: of the recording.
    """
    first = runs[0]
    return NavigationSummary(
        hours=float(first.time[-1] / HOUR),
        mechanisation=first.mechanisation,
        damping=aids.damping,
        alignment_s=aids.alignment,
        channels=tuple(
            _channel(run, first, i)
            for run in runs
            for i in range(len(CHANNELS))
            if np.all(np.isfinite(run.error[:, i]))
        ),
        position=tuple(_position(run, first) for run in runs),
        provenance=provenance,
        title=title,
        runs=tuple(runs),
    )


def _drawn_errors(run: Navigated, i: int) -> Array:
    """Return the errors (n,) of entry i of `_DRAWN`, in its unit; nan where the truth is not known."""
    if i == 0:
        return run.position / NAUTICAL_MILE
    return np.asarray(from_si(run.error[:, i - 1], CHANNELS[i - 1][1]))


def _position(run: Navigated, first: Navigated) -> PositionError:
    error = run.position / NAUTICAL_MILE
    gain = _improvement(first.position.max(), run.position.max(), run, first)
    return PositionError(run.label, float(error.max()), float(np.sqrt(np.mean(error**2))), float(error[-1]), gain)


def _channel(run: Navigated, first: Navigated, i: int) -> ChannelError:
    name, unit = CHANNELS[i]

    def printed(x: float) -> float:
        return float(from_si(float(x), unit))

    return ChannelError(
        name=name,
        unit=unit,
        calibration=run.label,
        max=printed(run.largest[i]),
        rms=printed(run.rms[i]),
        improvement_percent=_improvement(first.largest[i], run.largest[i], run, first),
        drift_per_day=printed(run.drift_per_day[i]),
        sigma_linear=None if run.linear is None else printed(run.linear[:, i].max()),
        sigma_sampled=None if run.sampled is None else printed(run.sampled[:, i].max()),
    )


def _improvement(before: float, after: float, run: Navigated, first: Navigated) -> float | None:
    return None if run is first or before == 0 else float(100 * (1 - after / before))
