"""Refits of sets after the search: to each recording, for a plant file, and for an experiment."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.recordings.join_recordings import part_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import listed

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import Configuration, Course, Span
from rulec.mismatch.evidence.evidence import id_of
from rulec.mismatch.evidence.model import HELDOUT
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, settled
from rulec.mismatch.evidence.steady.operating_state_means import rows_of_states
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.result import CandidateSet, Likely, Moved, Presence
from rulec.mismatch.search import limits
from rulec.mismatch.search.grow_sets import Progress
from rulec.mismatch.search.operating_states import begun, explain
from rulec.mismatch.search.posterior import Posterior, candidates_of, titled_with_module
from rulec.mismatch.search.refit import Model, refitted

# The result of each of several recordings alone, and the change by each further one.
#
# Each time the search runs on the rows of some recordings. Reusing the sets found on all rows
# would be cheaper and wrong: a set that a later recording refutes would have been refitted to its
# rows too, with the noise and errors of form that this needs, and would seem refuted before.

NOTHING = "nothing"
"""Id of the empty set of explanations."""

TERM = "~"
"""Mark before the driver in the name of a term without a name."""

SORTED = {"physics": "named", "ageing": "named", "fault": "fault", "sensor": "sensor"}
"""Verdict by the sort of the only certain explanation."""


@dataclass(frozen=True)
class SingleRecording:
    """The result of one recording, by its number, alone."""

    number: int
    verdict: str
    likely: tuple[Likely, ...]


@dataclass(frozen=True)
class ByRecording:
    """The result of each recording alone, and how the second and each later one, by its number,
    moved probabilities."""

    alone: tuple[SingleRecording, ...]
    moved: Mapping[int, tuple[Moved, ...]]


def by_recording(
    recording: Recording,
    system: System,
    heldout: Sequence[tuple[float, float]],
    posterior: Posterior,
    progress: Progress,
) -> ByRecording | None:
    """Search each recording alone, and the first few together; None for a single recording.

    `posterior` is that of all recordings.
    """
    count = len(recording.sources)
    if count < 2:
        return None
    searched = {frozenset(range(count)): _likely(posterior)}

    def on(numbers: Collection[int]) -> tuple[str, dict[str, Likely]]:
        chosen = frozenset(numbers)
        if chosen not in searched:
            progress(f"searching {listed([recording.sources[i] for i in sorted(chosen)])} alone")
            rows = _rows_of(part_of(recording, chosen), system, heldout)
            own = None if rows is None else explain(rows, lambda text: None)
            searched[chosen] = ("cannot judge", {}) if own is None else _likely(own)
        return searched[chosen]

    alone, moved = [], {}
    for number in range(count):
        verdict, every = on({number})
        likely = [one for one in every.values() if one.probability >= common.MENTIONED]
        likely.sort(key=lambda one: -one.probability)
        alone.append(SingleRecording(number, verdict, tuple(likely)))
    for number in range(1, count):
        moved[number] = _moved(on(range(number))[1], on(range(number + 1))[1])
    return ByRecording(tuple(alone), moved)


def _rows_of(
    recording: Recording, system: System, heldout: Sequence[tuple[float, float]]
) -> Rows | None:
    """Rows of some recordings; None where there are too few."""
    data = prepare(recording, system.ruleset, heldout)
    if data is None or int(data.open.sum()) < common.FEWEST_POINTS:
        return None
    rows = rows_of(system_of(system.ruleset, system.builder, data), Configuration())
    return rows if rows.groups >= common.FEWEST_POINTS else None


def _likely(posterior: Posterior) -> tuple[str, dict[str, Likely]]:
    """The verdict by probabilities only, and all explanations by id: one for a fault with any
    course, and for terms without a name over one driver.

    As in a finding, that errors of laws and sensors alone explain the misfit counts against
    explanations of the best set.
    """
    titles, sorts, shares = {NOTHING: "nothing left out"}, dict[str, str](), dict[str, float]()
    for candidate in candidates_of(posterior).values():
        key, title = candidate.id, titled_with_module(candidate)
        lower = title[:1].lower() + title[1:] if title[1:2].islower() else title
        titles[key], sorts[key] = lower, candidate.sort
    for names, probability in posterior.sets.items():
        keys = {id_of(name) for name in names if TERM not in name}
        for driver in {name.rpartition(TERM)[2] for name in names if TERM in name}:
            follows = "time" if driver == TIME else driver
            titles[TERM + driver] = f"something without a name over {follows}"
            keys.add(TERM + driver)
        for key in keys or {NOTHING}:
            shares[key] = shares.get(key, 0.0) + probability
    exact = posterior.tolerance.stand_out
    found = {
        key: Likely(key, titles[key], p * (1.0 - limits.INEXACT * (1.0 - exact.get(key, 1.0))))
        for key, p in shares.items()
    }
    if found[NOTHING].probability >= limits.LIKELIER:
        return "none", found
    best = max(found.keys() - {NOTHING}, key=lambda key: (found[key].probability, key))
    sort = SORTED.get(sorts.get(best, ""), "unnamed")
    unsure = sort != "unnamed" and found[best].probability < common.CERTAIN
    return "ambiguous" if unsure else sort, found


def _moved(first: Mapping[str, Likely], last: Mapping[str, Likely]) -> tuple[Moved, ...]:
    """Probabilities before and after of explanations that are likely in either; None before the
    first recording that could be judged."""
    found = []
    for key, one in {**first, **last}.items():
        old = first[key].probability if key in first else 0.0 if first else None
        new = last[key].probability if key in last else 0.0
        if max(old or 0.0, new) >= common.MENTIONED:
            found.append(Moved(key, one.title, old, new))
    return tuple(sorted(found, key=lambda one: (-max(one.before or 0.0, one.after), one.id)))


# Refit a set for a plant file: no errors of sensors and no errors of form.
#
# The weight of each row follows from the accuracy of its laws, or from a better one where the
# residual shows it. Rows that share an error of form count once.
#
# Source: Ribatet, Cooley, Davison 2012 (composite likelihood, scaled to the joint information of
# its parts); Tuo and Wu 2015 (the law that is to predict, not the one beside its error of form).


def clear_states(system: System, clear: np.ndarray) -> Rows:
    """Means of operating states in which all but `clear` points, shape (n,), are held out."""
    data = system.data
    part = np.where(clear, data.part, HELDOUT)
    ends = data.time[1:][np.diff(clear)]
    return rows_of_states(replace(system, data=replace(data, part=part)), ends)


def as_written(rows: Rows, starts: Sequence[Configuration]) -> Model:
    """The likeliest refit from several starts."""
    system, smooth, inexact = rows.system, SteadyEvidence(rows), 0.0
    squares = np.sum(smooth.forms**2, axis=0)
    # The effective number of independent errors of form.
    ways = float(squares.sum()) ** 2 / max(float(np.sum(squares**2)), 1e-300)
    alike = max(len(smooth.point) / ways, 1.0) if ways else 1.0
    stated = max(float(squares.sum()) / len(smooth.point), 1e-300)
    errors = smooth.shown(smooth.forms)
    for _ in range(common.ACCURACY_STEPS):
        noise, share = dict(system.data.noise), np.sqrt(alike) * inexact
        for name, error in errors.items():
            noise[name] = np.hypot(noise[name], share * error)
        noisier = replace(system, data=replace(system.data, noise=noise))
        evidence = SteadyEvidence(rows_of(noisier, Configuration()), exact=True)
        found = [refitted(evidence, start, without_error=system.shared) for start in starts]
        best = max(found, key=lambda model: model.evidence)
        starts = [best.setting]
        off = rows.errors(system.flows(best.setting))[0][smooth.open]
        inexact = float(np.sqrt(np.clip((np.mean(off**2) - 1.0) / stated, 0.0, 1.0)))
    return best


def possible_sets(posterior: Posterior) -> tuple[CandidateSet, ...]:
    """The sets that are still possible, the likeliest first."""
    found, candidates = [], candidates_of(posterior)
    sets = sorted(posterior.sets.items(), key=lambda s: (-s[1], sorted(s[0])))
    for names, probability in sets[: limits.SETS_STANDING]:
        if probability < common.REPORTED:
            continue
        model = posterior.models[names]
        setting, titles = (
            model.setting,
            {n: titled_with_module(candidates[n]) for n in names & candidates.keys()},
        )
        for term in model.terms:
            follows = f"follows {term.driver} in a way without a name"
            where = f"{term.changed.module}.{term.changed.place}"
            titles[term.name] = f"{where} {term.basis.says or follows}"
        one = CandidateSet(
            names=tuple(sorted(names)),
            titles=tuple(titles[name] for name in sorted(names)),
            probability=probability,
            joined=tuple(c.id for c in setting.joined),
            values={name: float(value) for name, value in setting.values.items()},
            fixed={name: float(value) for name, value in setting.fixed.items()},
            periods=tuple(
                Presence(c.unknown, tuple((s.since, s.until, s.level) for s in c.periods), c.grows)
                for c in setting.courses
            ),
            terms=tuple((term.name, term.basis.length) for term in model.terms),
        )
        found.append(one)
    return tuple(found)


@dataclass(frozen=True)
class Again:
    """Candidate sets and their refits to the means of operating states in `evidence`, in order."""

    evidence: SteadyEvidence
    sets: tuple[CandidateSet, ...]
    models: tuple[Model, ...]


def refitted_again(every: Rows, sets: Sequence[CandidateSet]) -> Again:
    """Refit sets from their earlier values, but for those with a term that switches with set
    points: its values at other set points are not known.

    Raises KeyError with the id of a candidate that the knowledge base does not have.
    """
    search = begun(every)
    evidence, plain = settled(search.evidence), search.models[frozenset()]
    # Terms that switch have no name and length of their own.
    smooth = [t for t in evidence.terms(plain.point) if not t.basis.says]
    named = {(t.name, t.basis.length): t for t in smooth}
    taken, models = [], []
    for one in sets:
        if any(not length for _, length in one.terms):
            continue
        own = tuple(named[name] for name in one.terms)
        first = search.refit(_setting(evidence, one), plain, own)
        # The plain model has large errors where an effect is missing, and these would explain part
        # of that effect; the second refit starts from the errors of the set itself.
        models.append(search.refit(first.setting, first, own))
        taken.append(one)
    return Again(evidence, tuple(taken), tuple(models))


def _setting(evidence: SteadyEvidence, one: CandidateSet) -> Configuration:
    time, courses = evidence.system.data.time, []
    for period in one.periods:
        spans = tuple(Span(*span) for span in period.spans)
        lasts = spans[-1].until >= float(time[-1])
        end = np.array([spans[-1].level if lasts else -1])
        risen = np.zeros(1) if period.grows else None
        courses.append(Course(period.unknown, end, spans, risen=risen).at_times(time))
    candidates = {candidate.id: candidate for candidate in evidence.system.builder.candidates}
    return Configuration(
        joined=tuple(candidates[id_] for id_ in one.joined),
        values=one.values,
        fixed=one.fixed,
        courses=tuple(courses),
    )
