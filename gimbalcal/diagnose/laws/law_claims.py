"""Decide whether the data determine a law outside the catalogue, estimate its sizes, and write law.py.

A law is named if its evidence, with the penalty for the number of laws tried, exceeds the threshold of any claim and is
within a factor 20 of that of the best shape, and if only a few others come as near. It is written as an effect, so that
`calibrate --with` and every other command take it by `--effects law.py`.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.odds import CLAIM, SEPARATION_EVIDENCE, UNKNOWN
from gimbalcal.diagnose.evidence.stated_noise import nats_beyond_stated_scatter, nominal_noise
from gimbalcal.diagnose.laws.expressions import Expression
from gimbalcal.diagnose.laws.law_curve import with_curves
from gimbalcal.diagnose.laws.law_file import found_law, printed_form
from gimbalcal.diagnose.laws.law_problems import with_law
from gimbalcal.diagnose.laws.law_search import (
    MIN_SHARE_OF_COLUMN,
    SAME_CORRELATION,
    STAGE,
    Law,
    LawProblem,
    aliases,
    centred_jumps,
    free_numbers,
    response_of,
    trimmed_law,
)
from gimbalcal.diagnose.laws.model_comparison import NAME_ODDS, LawsGivenCause, compare_models
from gimbalcal.diagnose.library.candidates import Candidate, SelectedCause
from gimbalcal.diagnose.result import LawResult, StatedNoiseFit, ViewFit
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.search.ranking import Ranking, Search, is_usual, search, selected_causes
from gimbalcal.diagnose.search.refit import fitted_columns, with_columns
from gimbalcal.diagnose.search.stepwise import Key, SearchResult, with_causes
from gimbalcal.diagnose.verdict.agreement import disagreement_sentence, inverse_of, mean_of
from gimbalcal.diagnose.verdict.decide import Decision, decide_unnamed, noise_gain
from gimbalcal.diagnose.verdict.mismatch import CLEAN_PROBABILITY, scan_data
from gimbalcal.diagnose.verdict.random_walk import RandomWalkFinding
from gimbalcal.diagnose.verdict.separation import expected_ln_bayes, fastest_manoeuvre
from gimbalcal.diagnose.verdict.verify import residual_rows, row_sigma, verify
from gimbalcal.effects import Stage
from gimbalcal.estimate.caveats import position_faults
from gimbalcal.inference.algebra import beyond, logsumexp, orthonormal, orthonormal_columns
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.recording.kinds import Kind
from gimbalcal.views.core import Fit
from gimbalcal.words import law_sentences
from gimbalcal.words.diagnosis_sentences import position_outliers_in_words, repeat_advice, separation_advice
from gimbalcal.words.naming import without_underscores

MAX_LAWS = 3  # laws of one view
LAW_EVIDENCE = (
    2 * CLAIM
)  # nats of the likeliest formula, less the cost of its refined constants, from which one is stated
NEARLY_BEST_NATS = 1.5  # nats within which the law of the fewest numbers is taken, of as many the likeliest
EQUAL_NATS = 0.1  # nats within which two laws are equally likely, and the one of lower degree is taken
MIN_EXPLAINED = 0.8  # of the excess misfit that a law, or a cause of probability above one half, has to explain
MIN_EXPLAINED_ALONE = 0.5  # of the same, that a law has to explain where nothing known does
MAX_COMPARED_LAWS = 12  # formulas that together are compared with causes
MIN_EXCESS_SIGMAS = 1.0  # sigmas of chi^2 that causes have to leave for an additional formula
SAME_COLUMN = 1e-3  # of a column, which a formula that spans the rest of it holds
SAME_RESPONSE = 2e-3  # of the square of what a formula adds: a cause that holds all but this is the formula
MIN_DIFFERENCE = 4.0  # of chi^2, by which a formula says something else than a cause
MIN_GROUPS = 20  # of rows that are held out together, from which on two are left out and not one
MAX_GAIN_CHANGE = 0.3  # of a sensor by a law: beyond, it is another sensor
MAX_SCATTER_RATIO = 1.5  # of a formula to causes with more parameters, from which on it replaces none

Terms = list[tuple[Key, tuple[int, ...]]]
"""Causes that a law spans, each with its columns in the library."""


@dataclass(frozen=True)
class LawSearchResult:
    """Laws that were found, or what would determine one; of each recording the fit with them and the rest (n, C)."""

    laws: tuple[LawResult, ...] = ()
    recommend: str = ""
    each: tuple[tuple[LawFit, Array], ...] = ()
    formula_is_likelier: bool = False  # than all causes, though it is not good enough to be reported
    ln_total: float = -np.inf  # ln evidence of the first law with its known cause, against nothing
    known: tuple[SelectedCause, ...] = ()  # causes of the catalogue that explain a view as well as the best formula
    position_outliers: str = ""  # sentences on positions that were not held as read: a fault, no law


def chosen_law(g: LawProblem, laws: Sequence[Law], shape: float) -> tuple[Law | None, list[Law]]:
    """Return the law to be stated, a closed form before a table, and those that are nearly as likely; None without one.

    shape: ln evidence of the best shape without a cause.
    """
    if not laws or laws[0].evidence < max(LAW_EVIDENCE, shape - SEPARATION_EVIDENCE):
        return None, []
    likely = [trimmed_law(g, law) for law in laws if law.evidence > laws[0].evidence - 2 * SEPARATION_EVIDENCE]
    likely = sorted((law for law in likely if not law.expression.simpler), key=lambda law: -law.posterior) or likely
    if likely[0].posterior < LAW_EVIDENCE:
        return None, []
    equivalent = [law for law in likely if law.posterior > likely[0].posterior - SEPARATION_EVIDENCE]
    closed = [law for law in equivalent if not any(t.form.key == "table" for t in law.expression.terms)]
    first = [law for law in closed if not law.wants_another_form] or closed or equivalent
    first = [law for law in first if law.posterior > first[0].posterior - NEARLY_BEST_NATS]
    simplest = _simplest(first)
    best, rivals, others = centred_jumps(g, simplest), [law for law in equivalent if law is not simplest], list[Law]()
    responses = {law: response_of(g, law) for law in (best, *rivals)}
    for law in rivals:
        alike = (o for o in (best, *others) if responses[o] @ responses[law] > SAME_CORRELATION)
        if not any(_is_only_longer(law, known) or _forms(law) == _forms(known) for known in alike):
            others.append(law)
    return best, [*others, *aliases(g, best)]


def _simplest(laws: Sequence[Law]) -> Law:
    """Return the law of the fewest numbers and terms, of these the likeliest, of equally likely ones the lowest degree.

    Where a design takes the forces -1, 0 and 1 g alone, a force and its cube are one; rounding must not decide.
    """
    size = {law: (free_numbers(law), len(law.expression.terms)) for law in laws}
    shortest = [law for law in laws if size[law] == min(size.values())]
    likeliest = max(law.posterior for law in shortest)
    equal = [law for law in shortest if law.posterior > likeliest - EQUAL_NATS]
    return min(equal, key=lambda law: (law.expression.degree, _order_of_listing(law)))


def _order_of_listing(law: Law) -> list[int]:
    """Return the ordinals of its variables among those that it may follow."""
    names = [v.name for v in law.places[0].variables]
    return [names.index(v.name) for v in law.expression.variables]


def _is_only_longer(law: Law, known: Law) -> bool:
    """Return whether a law has more numbers than a known one that follows nothing else."""
    of, own = ({v.name for v in one.expression.variables} for one in (known, law))
    return of <= own and free_numbers(law) > free_numbers(known)


def _forms(law: Law) -> list[tuple[str, str]]:
    """Return form and variable of each term of a law: at constants that make no difference here it is the same law."""
    return [(t.form.key, t.variable.name) for t in law.expression.terms]


def what_would_determine(laws: Sequence[Law], others: Sequence[Law], g: LawProblem, kind: Kind) -> str:
    """Return what would determine a law where these data do not, in a sentence."""
    s = g.places[0].stimulus
    if others and laws:
        alike = "; ".join(dict.fromkeys(printed_form(law) for law in [laws[0], *others][:3]))
        names = list(dict.fromkeys(v.name for law in [laws[0], *others] for v in law.expression.variables))
        spread = ", ".join(n.replace("_", " ") for n in names[:5])
        return law_sentences.SEVERAL_FORMULAS.format(more=kind.extended_by, names=spread, alike=alike)
    variables = (("temperature", s.temperature is not None), ("supply voltage, pressure", bool(s.covariates)))
    lacking = [words for words, there in variables if not there]
    return law_sentences.NO_FORMULA.format(lacking=" and ".join(lacking) or "another channel", more=kind.extended_by)


def law_of_misfit(
    ranked: Ranking, d: Decision, seed: int, progress: Progress, instead: Sequence[int] = ()
) -> LawSearchResult:
    """Return a formula for what no cause explains, in the noise that the likeliest shape leaves in each recording.

    Positions that were not held as read are a fault, not a law: of several recordings they are reported, and one is
    diagnosed again without them by the caller. ranked: all hypotheses; instead: the causes to be replaced, which leave
    a significant residual.
    """
    if d.verdict != "unexplained":
        return LawSearchResult()
    progress(law_sentences.SEARCHING_REPLACEMENT if instead else law_sentences.SEARCHING)
    faults = [position_faults(s.fit.view.source) for s in ranked.searches]
    if any(faults) and len(faults) == 1:
        return LawSearchResult()
    outliers = position_outliers_in_words([[f.in_words for f in own] for own in faults])
    nodes = [fit_causes(s, ranked.within(d.shapes, k)[:1]).projection.node for k, s in enumerate(ranked.searches)]
    law = law_of_searches(ranked, nodes, np.random.default_rng(seed), instead)
    if outliers and not law.laws:  # no position is held wrongly twice by chance
        law = LawSearchResult(recommend=law_sentences.REPEAT_POSITIONS)
    return replace(law, position_outliers=outliers)


def beyond_walk(
    common: Ranking, walk: RandomWalkFinding, seed: int, progress: Progress
) -> tuple[Decision, LawSearchResult, float]:
    """Return the shapes and the formula that compete with the walk of one sensor, and ln odds of the formula to it.

    common: the ranking without noises in which a single sensor walks. A walk has no formula.
    """
    none = decide_unnamed(common)
    law = law_of_misfit(common, none, seed, progress)
    none = none if law.laws or common.ln_total >= CLAIM else replace(none, shapes=())
    return none, *against_walk(law, walk, repeat_advice(common.searches[0].fit.view.kind.stabilised))


def law_beyond_shapes(ranked: Ranking, needed: float, seed: int, progress: Progress) -> LawSearchResult:
    """Return a formula of a misfit in which neither a cause nor a shape is likely, if there is one.

    A fast wave in a logged channel resembles no smooth shape, and the scatter of the rows or another noise absorbs it.
    It is sought where that exceeds the stated noise, or none was stated, and needs the prior odds of an unknown cause.
    needed: the ln Bayes factor of a claim, which clean recordings of this design do not reach.
    """
    stated = all(s.fit.view.kind.measured_by in s.fit.view.source.noise for s in ranked.searches)
    beyond_scatter = max(nats_beyond_stated_scatter(s.fit) for s in ranked.searches)
    if stated and max(beyond_scatter, noise_gain(ranked, ())) < CLAIM:
        return LawSearchResult()
    law = law_of_misfit(ranked, decide_unnamed(ranked), seed, progress)
    return law if law.ln_total + np.log(UNKNOWN) >= needed else LawSearchResult()


def against_walk(law: LawSearchResult, walk: RandomWalkFinding, advice: str) -> tuple[LawSearchResult, float]:
    """Return formulas that compete with the walk of a sensor, none of much lower odds, and ln of their odds to it.

    advice: what distinguishes the two, where the formulas have no advice of their own.
    """
    odds = law.ln_total - walk.ln_total
    without = LawSearchResult(recommend=law.recommend or advice, position_outliers=law.position_outliers)
    return law if odds > -CLAIM else without, odds


def law_of_searches(
    ranked: Ranking, nodes: Sequence[Node], rng: np.random.Generator, instead: Sequence[int]
) -> LawSearchResult:
    """Seek a law in recordings of known attitude of one unit that nothing known explains.

    nodes: the likeliest noise of each; ranked: all other hypotheses. instead: causes that leave a residual; the
    law then has to be 1000 times as likely, and they are doubtful where formulas together are likelier.
    """
    searches = ranked.searches
    b = _laws_and_noises(ranked, nodes, alone=bool(instead))
    g, every = b.problem, b.laws
    best_else = _best_else(ranked)
    best, others = chosen_law(g, every, best_else + (SEPARATION_EVIDENCE + NAME_ODDS) * bool(instead) - b.ln_known)
    if best is None and instead:
        likeliest = every[:MAX_COMPARED_LAWS]
        likelier = _joint_evidence(likeliest) > best_else  # else no selection of them is
        rivals = _rivals_of_members(ranked, instead, likeliest) if likelier else []
        return LawSearchResult(formula_is_likelier=_joint_evidence(rivals) > best_else)
    if best is not None and not instead and (as_likely := _known_causes_as_likely(ranked, best, b.total)):
        return LawSearchResult(recommend=as_likely)
    likely = best or next(iter(others and every), None)
    if likely is None:
        return LawSearchResult((), what_would_determine(every, others, g, searches[0].fit.view.kind))
    fits = [_law_in_recording(s, own, columns, rng)
            for s, own, columns in zip(searches, b.searches, g.parts(likely.columns), strict=True)]  # fmt: skip
    x, C, agree = mean_of([(h.x, h.weight) for h in fits])
    lead = max(range(len(fits)), key=lambda k: float(x @ fits[k].weight @ x))
    advice = separating_manoeuvre(searches[lead].fit, likely, x, others[0], asked=best is None) if others else ""
    if best is None:
        return LawSearchResult((), f"{what_would_determine(every, others, g, searches[0].fit.view.kind)}. {advice}")
    if disagreement_sentence(agree, ""):
        return LawSearchResult((), law_sentences.DIFFERENT_SIZES.format(law=printed_form(best)))
    before, after = (float(np.average([getattr(h.checked, w) for h in fits], weights=[len(s.rows.Q) for s in searches]))
                     for w in ("heldout_before", "heldout_after"))  # fmt: skip
    least = MIN_EXPLAINED if instead else MIN_EXPLAINED_ALONE
    if after >= before or any(h.checked.explained < least for h in fits):
        return LawSearchResult((), law_sentences.LACK_OF_FIT.format(law=printed_form(best)), formula_is_likelier=True)
    # once in 1 / CLEAN_PROBABILITY by chance, of the scan as of another noise
    if any(h.left < CLEAN_PROBABILITY or h.strained >= -np.log(CLEAN_PROBABILITY) for h in fits):
        advice = advice or law_sentences.LACK_OF_FIT.format(law=printed_form(best))
    title = " and ".join(s.fit.view.title for s in searches)
    laws = found_law(best, x, C, (before, after), others, title, known_effects=b.name)
    parts = g.parts(best.columns)
    remainders = [residual_rows(s.fit, A @ x)[1] for s, A in zip(b.searches, parts, strict=True)]
    joint = np.concatenate([r.reshape(-1, *g.shape[1:]) for r in remainders])  # rows of one channel, of several
    laws = with_curves(laws, best, x, C, joint, g, others)
    return LawSearchResult(laws, advice, tuple(zip(fits, remainders, strict=True)), ln_total=b.ln_known + best.evidence)


def _laws_and_noises(ranked: Ranking, nodes: Sequence[Node], alone: bool) -> LawsGivenCause:
    """Return the laws that explain most in the likeliest noise of each recording without a law, or in the stated one.

    A noise that explains what a law adds hides the law, as what is switched looks like the walk of a sensor. The
    evidence is that over all noises in either case.
    """
    stated = [nominal_noise(s.fit) for s in ranked.searches]
    among = [nodes] if [n.name for n in nodes] == [n.name for n in stated] else [nodes, stated]
    best = compare_models(ranked.searches, among, ranked, alone)
    assert best is not None  # every recording of known attitude has outputs
    return best


def leave_more_than_noise(ranked: Ranking, members: Sequence[int]) -> bool:
    """Return whether causes leave more than the likeliest noise, so that a formula may explain more."""
    for k, s in enumerate(ranked.searches):
        f = fit_causes(s, ranked.within(members, k))
        dof = len(s.rows.Q) - s.rows.q - len(f.index)
        if f.misfit - dof > MIN_EXCESS_SIGMAS * np.sqrt(2 * max(dof, 1)):
            return True
    return False


def _rivals_of_members(ranked: Ranking, members: Sequence[int], laws: Sequence[Law]) -> list[Law]:
    """Return the laws that say something else than causes in one recording.

    Of several recordings, which have calibration constants of their own, laws are taken for those of the causes.
    """
    if len(ranked.searches) > 1:
        return []
    (s,) = ranked.searches
    X = s.library.X[:, list(fit_causes(s, ranked.within(members, 0)).index)]
    return [law for law in laws if _differs_from_causes(s, law, X)]


def _best_else(ranked: Ranking) -> float:
    """Return ln evidence of the best causes, or of the best shape by itself: what a law competes with.

    A shape together with a cause may as well be a law together with that cause.
    """
    every = ranked.library.candidates
    return max(h.ln_weight for h in ranked.hypotheses if len({bool(every[i].rival) for i in h.members}) == 1)


def _joint_evidence(laws: Sequence[Law]) -> float:
    """Return the ln evidence of laws together, which is at least that of any selection of them; -inf of none."""
    return float(logsumexp(np.array([-np.inf, *(law.evidence for law in laws)])))


def _cancels_sensor(law: Law, x: Array) -> bool:
    """Return whether a law with sizes x (m,) [SI] takes away the response of its own sensor: no sensor is left then.

    The norm of the force is the same in every attitude, too, where accelerometers read nothing but their bias.
    """
    if law.channel != "specific_force":
        return False
    each = zip(law.places, x.reshape(len(law.places), -1), strict=True)
    sizes = {f"force_{place.axis}": law.expression.columns @ size for place, size in each}
    forces = ((v.x - v.x.mean(), sizes[v.name]) for v in law.places[0].variables if v.name in sizes)
    return any(abs(float(f @ added)) > MAX_GAIN_CHANGE * float(f @ f) for f, added in forces if f.any())


def _known_causes_as_likely(ranked: Ranking, law: Law, ln_evidence: float) -> str:
    """Return a sentence that names known causes that are as likely as a law of this evidence; "" where none are."""
    every, h = ranked.library.candidates, ranked.best_known
    if h is None or h.ln_weight < ln_evidence:
        return ""
    names = " and ".join(f"{without_underscores(every[m].effect)} {every[m].axis}".strip() for m in h.members)
    more = ranked.searches[0].fit.view.kind.extended_by
    return law_sentences.KNOWN_CAUSE.format(more=more, names=names, law=printed_form(law))


@dataclass(frozen=True)
class LawFit:
    """A law in one recording: its sizes (m,) [SI] and their weight (m, m), what it leaves, and the fit with it.

    left: p-value of the scan of the residuals.
    """

    x: Array
    weight: Array
    left: float
    strained: float
    checked: StatedNoiseFit

    def summary(self, without: StatedNoiseFit) -> StatedNoiseFit:
        """The entry `fit` with the law in the place of what was in the model `without` it."""
        return replace(
            self.checked, scan_p_before=without.scan_p_before, scan_p_after=self.left,
            calibration_moved=without.calibration_moved,
        )  # fmt: skip


def _law_in_recording(bare: Search, s: Search, columns: Array, rng: np.random.Generator) -> LawFit:
    """Fit the law with these columns (n, C, m) to one recording; `bare`: the search without the known cause."""
    extended, physical, scale = with_law(s, columns)
    f = fit_causes(extended, (0,))
    explained = extended.library.X if columns.any() else None
    p_value = scan_data(s.fit, s.rows, f.projection.node, rng, explained)
    checked = verify(f, physical)
    if s is not bare:
        same = next(p for p in bare.projections if p.node is f.projection.node)
        none = verify(replace(fit_causes(bare, ()), projection=same), np.zeros((*bare.fit.residual.shape, 0)))
        checked = replace(checked, chi2_reduced_before=none.chi2_reduced_before, heldout_before=none.heldout_before)
    weight = inverse_of(f.covariance * np.outer(scale, scale))
    return LawFit(f.x * scale, weight, p_value.p_value, noise_gain(extended, (0,)), checked)


def causes_replaced_by_a_formula(
    c: SearchResult, causes: Sequence[Candidate]
) -> tuple[tuple[Candidate, ...], frozenset[str]]:
    """Return the causes in the place of which a formula of the same rows is much likelier than anything known, or none;
    and the ids of effects that keep their place although formulas together are likelier.

    Two causes may imitate a formula together, so all are removed at once, then one after the other. Effects that every
    rig of the kind has stay in the model. A formula that leaves far more scatter than the causes replaces none, and one
    with as many coefficients none if it leaves more scatter at all: in noise with a memory a slow curve has much
    evidence and explains little of what a periodic cause does. A formula that spans a cause does not compete with it:
    it is that cause with an additional term. A formula that is one of the causes is as much known as the cause, and
    another formula has to be much likelier than it: at +-1 g alone a line and its cube cannot be distinguished.
    """
    special, doubtful = tuple(cause for cause in causes if not is_usual(cause, c.start.view.kind)), set[str]()
    for own in dict.fromkeys([special, *((cause,) for cause in special)] if special else []):
        names = {cause.key for cause in own}
        without = with_causes(c.start, [this for this in c.causes if this[0].key not in names])
        s = search(without)
        b = _compared_in(without, s, row_sigma(without))
        if b is None or not b.laws:
            continue
        likeliest, known = b.laws[:MAX_COMPARED_LAWS], max(h.ln_weight for h in s.hypotheses)
        if _joint_evidence(likeliest) <= known:
            continue
        known = max([known, *(law.evidence for law in likeliest if any(_is_cause(s, law, name) for name in names))])
        if b.laws[0].evidence < known + CLAIM:
            if _joint_evidence(_rival_laws(s, likeliest, names)) > known:
                doubtful |= {cause.effect for cause in own}
            continue
        fewer = _visible_columns(without, b.laws[0].columns) < sum(len(cause.parameters) for cause in own)
        limit = MAX_SCATTER_RATIO if fewer else 1.0
        if with_columns(without, b.laws[0].columns).scatter > limit * c.end.scatter:
            continue
        if _explains_more(s, b.laws[0], names, _terms_of(s, b.laws[0])):
            return own, frozenset(cause.effect for cause in causes)
    return (), frozenset(doubtful)


def _visible_columns(m: Fit, columns: Array) -> int:
    """Return how many of the columns (n, C, q) of a formula the model does not hold already."""
    Q, A = orthonormal_columns(m.reduced(m.jacobian)), m.reduced(columns)
    norm = np.linalg.norm(A, axis=0)
    remainder = beyond(Q, A) / np.where(norm > 0, norm, 1.0)
    return int(np.linalg.matrix_rank(remainder, tol=MIN_SHARE_OF_COLUMN))


def _rival_laws(s: Search, laws: Sequence[Law], names: Container[Key]) -> list[Law]:
    """Return the laws that explain something other than causes of these names do.

    A law that spans one of these causes is that cause with an additional term.
    """
    each = ((law, _terms_of(s, law)) for law in laws)
    others = ((law, terms) for law, terms in each if not any(key in names for key, _ in terms))
    return [law for law, terms in others if _explains_more(s, law, names, terms)]


def _is_cause(s: Search, law: Law, name: Key) -> bool:
    """Return whether a law is the cause of this name: it spans no cause, and explains nothing else."""
    terms = _terms_of(s, law)
    return not terms and not _explains_more(s, law, {name}, terms)


def _explains_more(s: Search, law: Law, names: Container[Key], terms: Terms) -> bool:
    """Return whether causes of these names, with those that are terms of a law, do not hold what the law explains."""
    own = [(c.key, v.index) for c in s.library.candidates if c.key in names for v in c.variants]
    columns = sorted({i for _, index in [*own, *terms] for i in index})
    return _differs_from_causes(s, law, s.library.X[:, columns])


def _terms_of(s: Search, law: Law) -> Terms:
    """Return causes with those columns of the library that a law spans, as a cubic spans the square."""
    Q, A = s.rows.Q, s.fit.reduced(law.columns)
    spanned, X = orthonormal_columns(beyond(Q, A)), beyond(Q, s.library.X)
    inside = np.linalg.norm(beyond(spanned, X), axis=0) < SAME_COLUMN * np.linalg.norm(X, axis=0)
    known = (c for c in s.library.candidates if not c.rival)
    return [(c.key, v.index) for c in known for v in c.variants if inside[list(v.index)].all()]


def _differs_from_causes(s: Search, law: Law, X: Array) -> bool:
    """Return whether reduced columns X (R, p) of causes do not hold what a law explains in its likeliest noise.

    They hold it if the remainder is a small share of it, or within the noise: then the law differs from them in the
    number of its constants, and not in its prediction of the rows.
    """
    node, Q, _, added = _whitened(s, law)
    X = node.whiten(X)
    causes = orthonormal_columns(beyond(Q, X))
    rest = float((beyond(causes, added) ** 2).sum())
    return rest > max(SAME_RESPONSE * float((added**2).sum()), MIN_DIFFERENCE)


def _evidence_without_clearest_groups(s: Search, law: Law) -> float:
    r"""Return the ln evidence of a law without the groups of rows, of those held out, that show it most.

    .. math:: (1 - p) (\ln E + c) - c , \qquad p = \sum_{g \in G} \frac{|y_g|^2 - |y_g - a_g|^2}{|y|^2 - |y - a|^2}

    with white rows y, what the law adds, a, what its choice among others costs, c, and G the two groups that show it
    most, of fewer than `MIN_GROUPS` the one. A gust, a knock, or a jump in noise with a memory is one event; among many
    formulas one follows two of them. Of few groups two are often the extremes of the design.
    """
    *_, y, added = _whitened(s, law)
    group = np.repeat(s.fit.view.groups, s.fit.residual.shape[1])
    if len(group) != len(y):
        return law.evidence
    gain, count = y**2 - (y - added) ** 2, 2 if len(np.unique(group)) >= MIN_GROUPS else 1
    share = np.sort(np.bincount(group, gain))[-count:].sum() / gain.sum()
    return float((1 - share) * (law.evidence + law.cost) - law.cost)


def _whitened(s: Search, law: Law) -> tuple[Node, Array, Array, Array]:
    """Return the likeliest noise given a law, and calibration, data and the addition in rows of its unit variance.

    Calibration Q (R, q) is orthonormal; data (R,), and what the law adds to them (R,), are without it.
    """
    node = fit_causes(with_law(s, law.columns)[0], (0,)).projection.node
    Q = orthonormal(node.whiten(s.rows.Q))
    A, data = (beyond(Q, B) for B in (node.whiten(s.fit.reduced(law.columns)), node.whiten(s.rows.y[:, :1])))
    B, y = orthonormal_columns(A), data[:, 0]
    added = B @ (B.T @ y)
    sigma = np.sqrt(((y - added) ** 2).sum() / max(len(y) - Q.shape[1] - B.shape[1], 1))
    return node, Q, y / sigma, added / sigma


def _compared_in(m: Fit, s: Search, sigma: Array, alone: bool = True) -> LawsGivenCause | None:
    """Return the laws of a view, in noise of `sigma` (n, C), that no two events show; alone: without a known cause."""
    one = float(np.sqrt(np.mean(m.view.noise.weighted(sigma) ** 2)))
    b = compare_models([s], [possible_noises(m, memory=False)], s, alone=alone, sigma=one)
    if b is None:
        return None
    laws = list[Law]()
    for law in b.laws:
        if law.evidence < max([CLAIM, *(best.evidence - 2 * SEPARATION_EVIDENCE for best in laws[:1])]):
            break  # what is said of a law is said of those near the best
        if _evidence_without_clearest_groups(b.searches[0], law) > 0:
            laws.append(law)
    return replace(b, laws=laws)


def laws_of_view(remaining: Search, sigma: Array, known: Sequence[str]) -> tuple[LawSearchResult, Fit]:
    """Seek laws in what a search of a view left, in noise of `sigma` (n, C); return the model with them too.

    One law after the other is added, until nothing is missing or what is missing has no formula. Where the library of
    shapes shows nothing missing, a formula also needs the prior odds of an unknown cause. The caller states the
    held-out misfit, as it has the numbers of the view. known: causes in the model, as --with takes them.
    """
    m = with_them = remaining.fit
    v, laws, total = m.view, list[LawResult](), -np.inf
    hidden = remaining.ln_total < CLAIM
    while not laws or (remaining.ln_total >= 2 * CLAIM and len({o.effect for o in laws}) < MAX_LAWS):
        b = _compared_in(m, remaining, sigma, alone=bool(laws) or hidden)
        if b is None:
            return LawSearchResult((), "" if hidden else law_sentences.REPEAT_TURNS), m
        g, every = b.problem, b.laws
        cost_of_choice = every[0].cost if every else 0.0  # a shape of the same rows was not chosen among formulas
        best, others = chosen_law(g, every, _best_else(remaining) - b.ln_known - cost_of_choice)
        if hidden and (best is None or best.evidence + np.log(UNKNOWN) < CLAIM):
            return LawSearchResult(), m
        if not laws and best is not None and (as_likely := _known_causes_as_likely(remaining, best, b.total)):
            assert remaining.best_known is not None
            causes = selected_causes(remaining, remaining.best_known.members)
            return LawSearchResult(recommend=as_likely, known=causes), m
        if best is None:
            lacking = law_sentences.LACK_OF_FIT.format(law=laws[0].expression) if laws else ""
            words = lacking or what_would_determine(every, others, g, v.kind)
            return LawSearchResult(tuple(laws), words, ln_total=total), with_them
        with_law_too, x, covariance = fitted_columns(b.searches[0].fit, best.columns)
        if _cancels_sensor(best, x):
            words = law_sentences.LACK_OF_FIT.format(law=printed_form(best))
            return LawSearchResult(tuple(laws), words, ln_total=total), with_them
        with_them, total = with_law_too, max(total, 0.0) + b.ln_known + best.evidence
        ids = [o.effect for o in laws]
        new = found_law(best, x, covariance, (0.0, 0.0), others, v.title, ids, v, (*known, *b.name))
        laws += with_curves(new, best, x, covariance, with_them.residual, g, others)
        remaining = search(with_them)
    return LawSearchResult(tuple(laws), ln_total=total), with_them


def with_heldout(law_search: LawSearchResult, fit: ViewFit) -> LawSearchResult:
    """Return the laws with the held-out misfit if they reduce it, else no law."""
    before, after = fit.heldout_before, fit.heldout_after
    if not law_search.laws or after < before:
        laws = (replace(law, heldout_before=before, heldout_after=after) for law in law_search.laws)
        return replace(law_search, laws=tuple(laws))
    return LawSearchResult((), law_sentences.LACK_OF_FIT.format(law=law_search.laws[0].expression))


def separating_manoeuvre(o: Fit, law: Law, size: Array, other: Law, asked: bool = True) -> str:
    """Return one sentence on the fastest manoeuvre to separate a law with coefficients `size` (m,) [SI] from another.

    asked: whether the question is open; else it is empty where no manoeuvre would distinguish them.
    """

    def gained(planned: Fit) -> float:
        signal = _columns(planned, law, law.expression) @ size[:, None]
        return expected_ln_bayes(planned, signal, (_columns(planned, other, e) for e in other.expression.varied()))

    best = fastest_manoeuvre(o, gained)
    if not (best.words or asked):
        return ""
    return separation_advice(best.words, best.hours, best.ln_bayes, printed_form(law), printed_form(other))


def _columns(o: Fit, law: Law, e: Expression) -> Array:
    """Return what a unit of each coefficient adds to the reduced rows of a recording, (R, m)."""
    stage = STAGE[law.channel]
    names, X = o.view.stimulus.axis_names if stage is Stage.ENCODER else "xyz", e.on(o.rows.seen[stage]).columns
    added = [o.rows.added_at_instants(stage, names.index(p.axis), X) for p in law.places]
    return np.asarray(o.reduced(np.concatenate(added, axis=-1)))
