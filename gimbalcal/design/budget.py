r"""The error budget of a planned calibration: what its remaining uncertainty costs in position, parameter by parameter.

A scenario says what will be recorded and how noisily, which gives the covariance P that the calibration will have. The
navigator says what each parameter does to the position of a still base, D (t) (2, p). The position error after T hours
is the largest one sigma on the way, and the part of parameter i is what would be gone if i were known exactly,

.. math:: \sigma^2(t) = \mathrm{tr}(D P D^T), \qquad \Delta_i(t) = \frac{|D P e_i|^2}{P_{ii}} ,

so that two parameters that are only known in their sum, which may be all that position asks for, count for nothing.
Parts add up to the whole where parameters are uncorrelated, and to more where they are not. A manoeuvre adds its rows
to the information, and the budget is drawn up again. Of a strapdown unit the calibration is by turns in its place
(`turning_budget`), and the navigator is its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.design.observability import AT_REST, information_at_rest
from gimbalcal.design.turning_budget import turned
from gimbalcal.earth import normal_gravity, radii
from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.expected import planned
from gimbalcal.estimate.accelerometers.setting import Noise, by_visit, position_parameters, problem, whiten
from gimbalcal.inference.information import Information, solve
from gimbalcal.navigate.mechanisations import is_strapdown, usual
from gimbalcal.navigate.space_stable import USUAL, Aids
from gimbalcal.navigate.stationary_base import ROW, static_plan, still_base
from gimbalcal.navigate.uncertainty import sensitivity
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.schedule import Hold, Schedule
from gimbalcal.simulate import Scenario, load
from gimbalcal.simulate.motion import planned as schedule_of
from gimbalcal.units import from_si

HOURS = (6.0, 24.0, 72.0)
EXTRA_HOLD, EXTRA_RUN = 600.0, 86400.0  # s: manoeuvres that are tried, ten more minutes in a position or a day at rest
PRIOR = 0.9  # of the prior sigma: the data then add less than a fifth to its information


@dataclass(frozen=True)
class Budget:
    """Parts of the position error: largest one sigma (h,) [m] within each of `hours`, and that of each parameter.

    sigma (p,) in SI is what the calibration leaves, parts (h, p) [m], share (p,) of the variance at the last hour;
    manoeuvre: of each parameter, what would reduce its part most, and to what [m]. strapdown: whose navigator it is.
    """

    title: str
    hours: tuple[float, ...]
    parameters: tuple[Parameter, ...]
    sigma: Array
    whole: Array
    parts: Array
    share: Array
    manoeuvres: tuple[Mapping[str, Any], ...]
    strapdown: bool = False

    @property
    def order(self) -> Array:
        """Indices of the parameters, the largest part at the last hour first."""
        return np.argsort(-self.parts[-1], kind="stable")

    @property
    def unseen(self) -> tuple[int, ...]:
        """Indices of the parameters that are known no better than they are expected to be anyway."""
        return tuple(i for i, p in enumerate(self.parameters) if self.sigma[i] >= PRIOR * p.sigma)

    @property
    def in_words(self) -> str:
        """The budget in two sentences."""
        first = int(self.order[0])
        name, m = self.parameters[first].label.replace(":", " ").replace("_", " "), self.manoeuvres[first]
        most, unseen = self.parts[-1, first], ", which it does not see" if first in self.unseen else ""
        return (
            f"the calibration leaves {length(self.whole[-1])} of position error (one sigma) in {self.hours[-1]:g} h, "
            f"the largest part, {length(most)}, by {name}{unseen}; {m['what']} would reduce that most, to "
            f"{length(m['to_m'])}"
        )

    def to_list(self) -> list[dict[str, Any]]:
        """The content of budget.json, the largest part first."""
        return [
            {
                "parameter": self.parameters[i].label,
                "sigma": float(from_si(self.sigma[i], self.parameters[i].unit)),
                "unit": self.parameters[i].unit,
                "position_error_m_after_h": {
                    f"{h:g}": float(m) for h, m in zip(self.hours, self.parts[:, i], strict=True)
                },
                "share": float(self.share[i]),
                "reduce_by": dict(self.manoeuvres[i]),
            }
            for i in map(int, self.order)
        ]


def length(metres: float) -> str:
    """A length as one says it.

    >>> length(24.31), length(12761.1)
    ('24.3 m', '12.8 km')
    """
    return f"{metres:.3g} m" if metres < 1000 else f"{metres / 1000:.3g} km"


def budget(
    scenarios: Sequence[str | Path],
    hours: Sequence[float] = HOURS,
    more: Sequence[str] = (),
    damping: float | None = None,
    states: str = "",
) -> Budget:
    """The error budget of a calibration from these scenarios together: positions, a static run, or turns in place.

    hours: the times [h] within which the position error is told; more: ids of effects that the calibration holds too,
    such as gyro_drift; damping of Schuler's swing, of critical (none: what `navigate` has); states: those of turns, 51
    unless said. Raises InputError for scenarios of another kind or platform, or without noise or latitude, and for
    effects that they do not show.
    """
    hours = sorted(hours)
    plans = [(str(s), load(s)) for s in scenarios]
    if any(s.kind == "rotation" for _, s in plans):
        info, besides, run = turned(plans, states or "51", more, max(hours))
    else:
        if states:
            raise InputError(f"--states {states}: of turns only; what a platform's calibration holds besides is --with")
        info, besides, run = _held(plans, more, max(hours))
    every = tuple(dict.fromkeys(p for each in (info, *(i for _, i in besides)) for p in each.parameters))
    time, answer = answer_of_position(run, every, usual(run, damping))
    D = dict(zip(every, np.moveaxis(answer, -1, 0), strict=True))
    own = _Parts.of(info, D, time, hours)
    tried = [(m, _Parts.of(both, D, time, hours)) for m, both in besides]
    best = []
    for p in info.parameters:
        after = [(t.parts[-1][t.parameters.index(p)], m) for m, t in tried]
        to, m = min(after, key=lambda each: each[0])
        best.append({**m, "to_m": float(to)})
    share = own.parts[-1] ** 2 / own.whole[-1] ** 2
    title = " and ".join(s.title for _, s in plans)
    return Budget(
        title, tuple(hours), info.parameters, own.sigma, own.whole, own.parts, share, tuple(best), is_strapdown(run)
    )


def _held(
    plans: Sequence[tuple[str, Scenario]], more: Sequence[str], hours: float
) -> tuple[Information, list[tuple[dict[str, Any], Information]], Recording]:
    """What positions and static runs of a platform tell, the same with each manoeuvre, and the base it navigates on."""
    also = _more(more)
    for name, scenario in plans:
        _refuse(scenario, name)
    each = [s for _, s in plans]
    site = _site(each)
    # what no scenario sees stays at its prior
    info = sum((_planned(s, site, also) for s in each), start=Information(also, np.zeros((1, len(also) + 1)), 0))
    return info, [(m, info + extra) for m, extra in _manoeuvres(each, site, also)], still_base(hours, site)


@dataclass(frozen=True)
class _Parts:
    parameters: tuple[Parameter, ...]
    sigma: Array
    whole: Array
    parts: Array

    @classmethod
    def of(
        cls, info: Information, by_parameter: Mapping[Parameter, Array], time: Array, hours: Sequence[float]
    ) -> _Parts:
        """What position (n, 2) [m] answers to one SI unit of each parameter, and what is known of them."""
        P, D = solve(info).covariance, np.stack([by_parameter[p] for p in info.parameters], axis=-1)
        DP = D @ P
        variance = np.einsum("ncp,ncp->n", DP, D)
        each = (DP**2).sum(axis=1) / np.maximum(np.diag(P), 1e-300)
        upto = [time <= 3600 * h for h in hours]
        whole = np.array([np.sqrt(variance[u].max()) for u in upto])
        parts = np.array([np.sqrt(each[u].max(axis=0)) for u in upto])
        return cls(info.parameters, np.sqrt(np.diag(P)), whole, parts)


def answer_of_position(run: Recording, wanted: Sequence[Parameter], aids: Aids = USUAL) -> tuple[Array, Array]:
    """Times (n,) [s], ten minutes apart, and position north and east (n, 2, p) [m] per SI unit of each parameter."""
    step = np.array([p.sigma for p in wanted]) * 0.01  # small: the slope at a perfect unit
    L = float(run.site.latitude or 0.0)
    M, N = radii(L)
    metres = np.array([M + run.site.height, (N + run.site.height) * np.cos(L)])
    time, D = sensitivity(run, (), wanted, step, aids)
    few = np.arange(len(time))[:: -max(1, round(ROW / float(np.median(np.diff(time)))))][::-1]
    return time[few], D[few, :2] * metres[:, None] / step


def _more(ids: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of effects beyond the baseline of a static run."""
    for i in ids:
        if i not in CATALOGUE or "static-run" not in CATALOGUE[i].kinds or CATALOGUE[i].requires:
            raise InputError(f"--with {i}: no effect of that name shows in a static run by its angles and forces alone")
    new = [i for i in ids if i not in BASELINE["static-run"]]
    return tuple(p for i in new for p in parameters(CATALOGUE[i], SPACE_STABLE.axis_names))


def _planned(s: Scenario, site: Site, also: Sequence[Parameter]) -> Information:
    """What a scenario will tell."""
    if s.kind == "static-run":
        return _at_rest(s, s.schedule.duration, site, also)
    schedule = schedule_of(s)
    held = [Hold(h.angles, s.schedule.dwell or h.duration) for h in schedule.holds] * s.schedule.sweeps
    return _in_positions(s, Schedule(schedule.name, schedule.platform, tuple(held)), site)


def _in_positions(s: Scenario, schedule: Schedule, site: Site) -> Information:
    samples = schedule.holds[0].duration * s.schedule.rate
    p = problem(planned(schedule, max(samples, 1.0), site), position_parameters(schedule.platform))
    linear = by_visit(p, np.zeros(len(p.parameters)), np.zeros((p.visits, p.turns)))
    return whiten(linear, Noise(s.noise.accelerometer, s.noise.gimbal_angle)).information(p.parameters)


def _at_rest(s: Scenario, seconds: float, site: Site, also: Sequence[Parameter]) -> Information:
    run = static_plan(seconds / 3600, float(site.latitude or 0.0), 1 / s.schedule.rate)
    held = tuple(p for e in BASELINE["static-run"] for p in parameters(CATALOGUE[e], run.platform.axis_names))
    wanted = (*held, *also)
    told = {sensor: float(getattr(s.noise, sensor)) for sensor in AT_REST}
    return information_at_rest(run, wanted, {sensor: sigma for sensor, sigma in told.items() if sigma > 0})


def _manoeuvres(
    plans: Sequence[Scenario], site: Site, also: Sequence[Parameter]
) -> list[tuple[dict[str, Any], Information]]:
    """What could be done besides: ten more minutes in one position of a schedule, or a day at rest.

    Where no static run is planned, its samples and readouts are taken to be as good as those of the positions.
    """
    runs = [s for s in plans if s.kind == "static-run"]
    another = {"what": f"{'another' if runs else 'a run of'} 24 h at rest", "hours": EXTRA_RUN / 3600}
    out = [(another, _at_rest((*runs, *plans)[0], EXTRA_RUN, site, also))]
    for s in plans:
        if s.kind == "static-run":
            continue
        schedule = schedule_of(s)
        for i, h in enumerate(schedule.holds):
            one = Schedule(schedule.name, schedule.platform, (Hold(h.angles, EXTRA_HOLD),))
            what = {"what": f"ten more minutes in position {i + 1} of {schedule.name}", "hours": EXTRA_HOLD / 3600}
            out.append((what, _in_positions(s, one, site)))
    return out


def _refuse(s: Scenario, name: str) -> None:
    """Raise InputError for a scenario that no budget can be drawn up for."""
    if s.kind not in ("multi-position", "static-run") or s.platform.name != SPACE_STABLE.name:
        raise InputError(
            f"{name}: a {s.kind} of {s.platform.name!r} has no budget; give positions or a static run of a "
            "space-stable platform, or turns of a strapdown unit in its place, such as wei2022-30"
        )
    if not s.noise.accelerometer > 0:
        raise InputError(f"{name}: noise.accelerometer: without noise everything would be known; state it")


def _site(plans: Sequence[Scenario]) -> Site:
    """Where the base stands: the first latitude that a scenario tells."""
    place = next((s.site for s in plans if s.site.latitude is not None), None)
    if place is None or place.latitude is None:
        raise InputError("a budget needs site.latitude in one of the scenarios: the base stands somewhere")
    gravity = float(normal_gravity(place.latitude, place.height)) if place.gravity is None else place.gravity
    return Site(place.latitude, place.height, gravity)
