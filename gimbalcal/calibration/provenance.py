"""The provenance of a calibration: its files, the noise it assumed, and the options and results of its method.

Every key of `provenance` in calibration.json is a field here, in the unit that its name ends with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, nan
from typing import Any

from gimbalcal.effects.loading import EffectFile
from gimbalcal.entries import Entry, Json, entry_from
from gimbalcal.recording import Source

GYRO = "gyro_"  # prefix of the options of the gyroscopes in a calibration of both triads
DIRECTION = "physics to reading"  # of every calibration here: effects are what is added to the reading


@dataclass(frozen=True)
class AssumedNoise(Entry):
    """One sigma of a sample, of a gimbal setting and of a star that the fit assumed, and the source of each.

    A setting error is infinite, null in the file, where gimbal angles are not used.
    """

    accelerometer_ug: float | None = None
    accelerometer_from: str | None = None
    star_arcsec: float | None = None
    gimbal_angle_arcsec: float | None = None
    gimbal_angle_from: str | None = None
    from_: str | None = None  # of all channels alike

    @property
    def known_setting_arcsec(self) -> float | None:
        """One sigma of a gimbal setting; None where it is not stated or gimbal angles are not used."""
        sigma = self.gimbal_angle_arcsec
        return sigma if sigma is not None and isfinite(sigma) else None


@dataclass(frozen=True)
class Session(Entry):
    """One of several recordings against all others; p_value is nan, null in the file, where it cannot be judged."""

    title: str
    in_words: str
    p_value: float | None = nan
    rests: int | None = None
    stops: int | None = None


@dataclass(frozen=True)
class AssumedGrade(Entry):
    """The grade of the unit, and what it was taken from.

    own: where a fleet was the prior, value and sigma [SI] by label of a parameter without it.
    """

    name: str
    from_: str
    own: Mapping[str, tuple[float, float]] | None = None


@dataclass(frozen=True)
class North(Entry):
    """Where the x axis of the base points, east of north, with one sigma."""

    east_of_north_deg: float
    sigma_deg: float


@dataclass(frozen=True)
class AttitudeReference(Entry):
    """The attitude that gyroscopes were compared with: its delay, mounting (3, 3) and noise, and the intervals used.

    The walk is that of the angle between rates and attitude.
    """

    lag_ms: float
    lag_sigma_ms: float
    mounting: tuple[tuple[float, ...], ...]
    mounting_sigma_arcmin: tuple[float, ...]
    noise_arcmin: float
    walk_deg_per_sqrt_h: float
    intervals: int


@dataclass(frozen=True)
class SplitRecord(Entry):
    """Each third of a record by itself: values and sigmas by label, in printed units, p-value that all agree."""

    p_value: float
    values: Mapping[str, tuple[float, ...]]
    sigmas: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class AlternativeSolution(Entry):
    """Another minimum that the data do not exclude: what chi^2 is above the written one, and values by label."""

    chi2_rise: float
    values: Mapping[str, float]  # in printed units


@dataclass(frozen=True)
class Options(Entry):
    """The options of a method, and what it reports in addition to its parameters.

    gyro: those of the gyroscopes in a calibration of both triads, written with the prefix `gyro_`.
    """

    method: str | None = None
    direction: str | None = None
    frame: str | None = None
    sensor: str | None = None  # of several that were logged side by side
    states: str | None = None
    terms: tuple[str, ...] | None = None
    with_: tuple[str, ...] | None = None
    without: tuple[str, ...] | None = None
    causes: tuple[str, ...] | None = None  # that a diagnosis added
    file: str | None = None
    format: str | None = None
    grade: AssumedGrade | None = None
    in_words: str | None = None
    question: str | None = None
    sessions: tuple[Session, ...] | None = None
    cross_check: tuple[str, ...] | None = None
    gravity: float | None = None  # m/s^2
    gravity_sigma_ppm: float | None = None
    nominal: Mapping[str, float | Sequence[float]] | None = None  # scale and offset of counts
    excess_scatter: float | None = None  # m/s^2, beyond the noise of the samples
    excess_over_noise: float | None = None
    condition: float | None = None
    leave_one_out_rms: float | None = None
    inter_triad_arcsec: tuple[float, ...] | None = None
    inter_triad_sigma_arcsec: tuple[float, ...] | None = None
    declined: Mapping[str, str] | None = None  # terms, each with the reason
    left_out: tuple[int, ...] | None = None  # positions
    gyroscopes: str | None = None  # why they are not calibrated
    pairs: int | None = None  # of revolutions both ways
    rests: int | None = None
    turned_each_way: float | None = None
    scatter_over_noise: float | None = None
    stretches: tuple[int, ...] | None = None  # of steady turning, in each recording
    north: North | None = None
    reference: AttitudeReference | None = None
    velocity_m_per_s: float | None = None
    stops: int | None = None
    gyro: Options | None = None

    def to_dict(self) -> Json:
        """Return the entry as it stands in the file."""
        entry = super().to_dict()
        gyro = entry.pop("gyro", {})
        return entry | {f"{GYRO}{key}": value for key, value in gyro.items()}


@dataclass(frozen=True)
class ResidualPattern(Entry):
    """A residual of stars that follows an axis of the mount, and the probability that noise looks so."""

    channel: str
    axis: str
    probability: float


@dataclass(frozen=True)
class FarStar(Entry):
    """A star far off the others: title of its run, number from 1, distance, and the likely reason."""

    title: str
    star: int
    arcsec: float
    why: str


@dataclass(frozen=True)
class MountAxes(Entry):
    """The mount by whose kind, axes and latitude its terms have names in TPOINT."""

    kind: str
    axes: tuple[str, ...]
    latitude_deg: float | None = None


@dataclass(frozen=True)
class PrintedTerm(Entry):
    """A term of a TPOINT model with one sigma, and its change since the usual terms alone (else since zero)."""

    term: str
    value: float
    sigma: float
    unit: str
    change: float | None = None


@dataclass(frozen=True)
class TermTest(Entry):
    """The test of one term of a mount: the model with and without it.

    term: label of the parameter with value and sigma; the effect where that has constants, all of it. p_value: of the
    F test with these degrees of freedom (null: of the stated noise). correlations: the largest with other terms.
    """

    term: str
    in_model: bool
    rms_without_arcsec: float
    rms_with_arcsec: float
    F: float
    dof: tuple[int, int | None]
    p_value: float
    correlations: Mapping[str, float]
    tpoint: str | None = None
    value: float | None = None
    sigma: float | None = None
    unit: str | None = None


@dataclass(frozen=True)
class NightTerm(Entry):
    """A term of one night with one sigma, and its change since the first night."""

    value: float
    sigma: float
    unit: str
    change: float | None = None
    change_sigma: float | None = None


@dataclass(frozen=True)
class Night(Entry):
    """One night of a pointing run: its stars, their rms residual on the sky, and its terms by label."""

    title: str
    start_s: float
    stars: int
    rms_arcsec: float
    terms: Mapping[str, NightTerm]


@dataclass(frozen=True)
class Provenance(Entry):
    """Files, noise, options and results of a calibration; `created` and `recorded` are dates of ISO 8601."""

    recordings: tuple[Source, ...] = ()
    effects: tuple[EffectFile, ...] | None = None
    noise: AssumedNoise | None = None
    setting_errors_arcsec: tuple[Mapping[str, float], ...] | None = None
    left_out: tuple[tuple[int, ...], ...] | None = None  # positions of each fault
    lost: str | None = None  # what missing positions cost
    notes: tuple[str, ...] | None = None
    limits: tuple[str, ...] | None = None
    agreement: Json | None = None  # of several recordings on the constants
    thirds: SplitRecord | None = None
    other_solutions: tuple[AlternativeSolution, ...] | None = None
    pattern: ResidualPattern | None = None
    far_off: tuple[FarStar, ...] | None = None
    stars: int | None = None
    mount: MountAxes | None = None
    tpoint: tuple[PrintedTerm, ...] | None = None
    population_sd_arcsec: float | None = None  # on the sky, TPOINT's `Popn SD`
    term_tests: tuple[TermTest, ...] | None = None
    nights: tuple[Night, ...] | None = None
    same_terms_every_night: float | None = None  # p-value
    version: str | None = None
    seed: int | None = None
    options: Options = field(default_factory=Options)
    recorded: str | None = None
    created: str | None = None
    remarks: tuple[str, ...] | None = None

    @classmethod
    def read(cls, content: object) -> Provenance:
        """Return the `provenance` of a calibration.json. Raises InputError, which names the place of a wrong type."""
        if isinstance(content, Mapping):
            content = {key: value for key, value in content.items() if value != {}}  # of what is absent
        if isinstance(content, Mapping) and isinstance(options := content.get("options"), Mapping):
            gyro = {key.removeprefix(GYRO): value for key, value in options.items() if key.startswith(GYRO)}
            content = {**content, "options": {**options, "gyro": gyro or None}}
        return entry_from(cls, content, "provenance")

    @property
    def date(self) -> str:
        """The date of its recordings, else that of the computation; empty where neither is stated."""
        return self.recorded or self.created or ""

    def with_options(self, **changes: Any) -> Provenance:
        """Return the provenance with options changed."""
        return replace(self, options=replace(self.options, **changes))

    def to_dict(self) -> Json:
        """Return `provenance` of calibration.json; nothing in a calibration is drawn, so its seed is null."""
        return {**super().to_dict(), "seed": self.seed}
