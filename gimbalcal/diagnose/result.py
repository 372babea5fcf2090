"""The parts of a diagnosis, as types: what is named, what stays unexplained, where, and how well the model then fits.

Each part is one entry of diagnosis.json: its fields carry the names of the file, values are in the unit of print, and
`to_dict` writes it. A field that is None is absent from the file. `part["key"]` reads a field by its name in the file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.effect import stated_law
from gimbalcal.entries import Entry, Json
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

MAX_HELDOUT_RATIO = 2.5  # of held-out rms to fitted rms; above it the data do not test the model


@dataclass(frozen=True)
class Estimate(Entry):
    """A parameter with its value and one sigma, in its unit of print; coefficients of a law have no axis."""

    name: str
    axis: str | None
    value: float
    sigma: float
    unit: str

    @classmethod
    def of(cls, p: Parameter, x: float, sigma: float) -> Estimate:
        """Return a parameter with its value and one sigma, both in SI."""
        return cls(p.name, p.axis, float(from_si(x, p.unit)), float(from_si(sigma, p.unit)), p.unit)

    def in_unit(self, unit: str) -> Estimate:
        """Return the estimate in another unit."""
        value, sigma = (float(from_si(to_si(x, self.unit), unit)) for x in (self.value, self.sigma))
        return self if unit == self.unit else replace(self, value=value, sigma=sigma, unit=unit)


@dataclass(frozen=True)
class RecordingSize(Entry):
    """The size of a finding by one of several recordings: the number of the recording, significance, parameters."""

    recording: int
    sigma: float
    parameters: tuple[Estimate, ...]


@dataclass(frozen=True)
class SizeAgreement(Entry):
    """Whether several recordings agree on the size of a finding; `in_words` is empty where they do."""

    chi2: float
    dof: int
    p_value: float
    in_words: str


@dataclass(frozen=True)
class Cost(Entry):
    """Largest error of position [n mile] of a navigator whose calibration holds a cause, and of one without it."""

    hours: float
    with_nmi: float
    without_nmi: float
    in_words: str
    uncalibrated_nmi: float | None = None


@dataclass(frozen=True)
class Finding(Entry):
    """A named cause: probability of its set, significance [sigma], sizes, and the effects confounded with it."""

    effect: str
    axis: str
    probability: float
    sigma: float
    parameters: tuple[Estimate, ...]
    twins: tuple[str, ...] = ()
    separate_by: str = ""
    recordings: tuple[RecordingSize, ...] | None = None
    agreement: SizeAgreement | None = None
    cost: Cost | None = None

    @property
    def physics(self) -> str:
        """First sentence of the effect's card."""
        return " ".join((CATALOGUE[self.effect].__doc__ or "").strip().split("\n\n")[0].split())

    @property
    def alone(self) -> Finding:
        """The finding without the effects that are confounded with it."""
        return replace(self, twins=())

    def to_dict(self) -> Json:
        """Return the entry with the physics, the equation and the reference temperature of the effect's card."""
        return {**super().to_dict(), "physics": self.physics, **stated_law(CATALOGUE[self.effect])}


@dataclass(frozen=True)
class Mismatch(Entry):
    """Where the baseline differs from the data: channel, axis, rows or pattern, and the p-value of the whole scan."""

    channel: str
    axis: str
    where: Json
    statistic: float
    p_value: float
    in_words: str
    recording: int | None = None


@dataclass(frozen=True)
class Shape(Entry):
    """A residual without a known cause: its channel, and in words what it depends on."""

    channel: str
    shape: str
    recordings: tuple[int, ...] | None = None


@dataclass(frozen=True, eq=False)
class LawCurve:
    """A law over what it follows, for a picture: rows (n,) in units of print, with what the recording shows there.

    x: of the one variable of the law, else what the law adds. law, sigma: what it adds, and one sigma of it by its
    coefficients. observed: that and what the sensor's residual leaves. predicted: what it adds where it is fitted to
    rows elsewhere in its domain. others: laws that fit as well, in print.
    """

    x: Array
    x_label: str
    law: Array
    sigma: Array
    observed: Array
    predicted: Array
    others: tuple[tuple[str, Array], ...] = ()


@dataclass(frozen=True)
class LawTable(Entry):
    """A law without a closed form: straight lines between knots of its variable, constant beyond the first and last.

    knots (k,): in the unit of print of the variable. values (k,), sigma (k,): what the law adds there, and one sigma of
    it, in `unit`; both are zero at the first knot, as the calibration holds a constant.
    """

    knots: tuple[float, ...]
    values: tuple[float, ...]
    sigma: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class LawResult(Entry):
    """A law outside the catalogue (interfaces.md section 6), and the class that states it in law.py.

    The expression of a table is "table"; diagnosis.json states its knots, values and sigmas as its parameters, which
    are here the slopes between the knots. steps (k, m): its values for a unit of each, in units of print.
    """

    channel: str
    axis: str
    variables: tuple[str, ...]
    expression: str
    form: str
    unit: str
    latex: str
    parameters: tuple[Estimate, ...]
    domain: Mapping[str, Sequence[float]]
    units: Mapping[str, str]
    evidence: float
    heldout_before: float
    heldout_after: float
    alternatives: tuple[str, ...]
    effect: str
    with_: str
    known_effects: tuple[str, ...]
    source: str = ""
    curve: LawCurve | None = None
    table: LawTable | None = None
    steps: Array | None = None

    def to_dict(self) -> Json:
        """Return the entry; its class goes to law.py, its curve into the picture."""
        inner = ("source", "curve", "table", "steps")
        entry = {key: value for key, value in super().to_dict().items() if key not in inner}
        return entry if self.table is None else entry | {"parameters": self.table.to_dict()}


@dataclass(frozen=True)
class Shift(Entry):
    """The change of a calibration constant once the findings are in the model, with its sigma."""

    name: str
    axis: str
    moved: float
    sigma: float
    unit: str
    in_sigmas: float


@dataclass(frozen=True)
class DetectionLimit(Entry):
    """The least size of an effect that would have shown, and its usual size."""

    effect: str
    axis: str
    least: float
    usual: float
    unit: str


@dataclass(frozen=True)
class SearchStep(Entry):
    """A cause in the order in which the causes explain the data, and the rms misfit with it in the model."""

    effect: str
    axis: str
    rms: float
    unit: str


@dataclass(frozen=True)
class Delay(Entry):
    """The delay of a sensor between positions, with its sigma."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class RmsMisfit(Entry):
    """Rms misfit of the readings without and with the findings."""

    rms_before: float
    rms_after: float
    unit: str


@dataclass(frozen=True)
class RowNoise(Entry):
    """One sigma of a row of a view of unknown noise scale."""

    of: str
    sigma_of_a_row: float
    unit: str
    from_: str = "the scatter about the last model"


@dataclass(frozen=True)
class Evidence(Entry):
    """The ln Bayes factor of anything missing in a noise of known scale, and what it is compared with."""

    ln_bayes_factor: float
    ln_bayes_factor_needed: float
    false_alarm_rate_simulated: float
    causes_compared: int
    excess_kurtosis: float
    probability_unknown: float


@dataclass(frozen=True)
class SeparateVerdict(Entry):
    """The verdict on one of several recordings analysed by itself, its ln Bayes factor and the threshold for it."""

    verdict: str
    in_words: str
    ln_bayes_factor: float
    ln_bayes_factor_needed: float


@dataclass(frozen=True, kw_only=True)
class FitSummary(Entry):
    """Reduced chi^2 of the fit and of data held out, without and with the findings; of several views, each of theirs.

    constants: how well several recordings agree on the constants of the unit.
    """

    chi2_reduced_before: float
    chi2_reduced_after: float
    heldout_before: float
    heldout_after: float
    noise: Mapping[str, float] | RowNoise
    calibration_moved: tuple[Shift, ...] = ()
    unseen: tuple[DetectionLimit, ...] | None = None
    views: Mapping[str, FitSummary] | None = None
    recordings: tuple[RecordingFit, ...] | None = None
    constants: Entry | None = None

    @property
    def misfit(self) -> RmsMisfit | None:
        """The rms misfit where the noise was estimated from the residual, so that chi^2 does not test the fit."""
        return None

    @property
    def excess_scatter(self) -> tuple[float, str]:
        """Return the residual of a view over the noise of its samples, and the view; 0 where that noise is unknown."""
        return 0.0, ""

    @property
    def untested(self) -> bool:
        """Return whether rows held out are off far more than fitted ones; a noise that is stated tests the fit."""
        return False

    @property
    def predicts_worse(self) -> bool:
        """Return whether rows held out are predicted worse with what was found than without it."""
        return self.heldout_after > self.heldout_before


@dataclass(frozen=True, kw_only=True)
class StatedNoiseFit(FitSummary):
    """The fit in a noise of known scale: what was held out, autocorrelation of residuals, the scan for a mismatch."""

    heldout_by: str
    autocorrelation_after: float
    autocorrelation_sigma: float
    scan_p_before: float
    scan_p_after: float

    @property
    def explained(self) -> float:
        """The share of the misfit beyond noise that what was added to the model explains."""
        excess = self.chi2_reduced_before - 1
        return (self.chi2_reduced_before - self.chi2_reduced_after) / excess if excess > 0 else 1.0


@dataclass(frozen=True, kw_only=True)
class ViewFit(FitSummary):
    """The fit of a view of unknown noise scale: rms misfits in its unit, and chi^2 against the samples' scatter.

    rms_of_channels: rms misfit of each channel of a pointing run, where these have scales of noise of their own.
    """

    noise: RowNoise
    rms_before: float
    rms_after: float
    heldout_rms_before: float
    heldout_rms_after: float
    steps: tuple[SearchStep, ...]
    late: Mapping[str, Delay] | None = None
    turns: RmsMisfit | None = None
    rms_of_channels: Mapping[str, float] | None = None
    chi2_of_samples_before: Mapping[str, float] | None = None
    chi2_of_samples_after: Mapping[str, float] | None = None

    @property
    def misfit(self) -> RmsMisfit | None:
        """The rms misfit of the view in its unit."""
        return RmsMisfit(self.rms_before, self.rms_after, self.noise.unit)

    @property
    def excess_scatter(self) -> tuple[float, str]:
        """The rms residual over the standard error from the scatter of the samples, and the view."""
        chi2 = list((self.chi2_of_samples_after or {}).values())
        return (sum(chi2) / max(len(chi2), 1)) ** 0.5, self.noise.of

    @property
    def predicts_worse(self) -> bool:
        """Return whether rows held out are predicted worse with what was found, and far worse than fitted rows."""
        return self.untested and self.heldout_rms_after > self.heldout_rms_before

    @property
    def untested(self) -> bool:
        """Return whether rows held out are off far more than fitted ones, or no effect of a usual size would show."""
        return self.unseen == () or self.heldout_rms_after > MAX_HELDOUT_RATIO * self.rms_after


@dataclass(frozen=True)
class RecordingFit(Entry):
    """One of several recordings: number, title, kind, its own fit, and the verdict on it by itself."""

    recording: int
    title: str
    kind: str
    fit: FitSummary
    alone: SeparateVerdict

    def to_dict(self) -> Json:
        """Return the entry, the numbers of the fit among its own."""
        entry = super().to_dict()
        return {**entry.pop("fit"), **entry}
