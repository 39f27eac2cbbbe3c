"""A library of our catalogue's own terms: how each candidate effect moves a reading.

A column is the change of the predicted reading when an effect is joined to the base plant at its
usual size, all else held; effects with shapes have several. Those that the reading does not tell
apart are one column with several causes, as they are one class in our own answer.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.points import points_of_stretches
from rulec_runtime.recordings.point_table import each_row
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import noise_at_work

from rulec.effects.candidate import Candidate
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.limits import STATISTICAL_SHARE
from rulec.mismatch.evidence.model import ESTIMATION, HELDOUT
from rulec.mismatch.evidence.prior import size_of
from rulec.mismatch.evidence.steady.evidence import share_of
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.repaired_model import Predictor, predictor_of
from rulec.mismatch.evidence.steady.screen import has_drivers, references, starts
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.limits import SAME_PATTERN
from rulec.prove.real.score import Cause
from tests.rig.peers import limits
from tests.rig.peers.case import Case
from tests.rig.peers.sparse import Array, Course, rms


@dataclass(frozen=True)
class Column:
    """What an effect does to a reading, `rows` shape (n,) in its unit, and what else does so."""

    rows: Array
    causes: tuple[Cause, ...]


@dataclass(frozen=True)
class Library:
    """Columns of a reading over the rows of training and test; `course` has its residual in
    training."""

    columns: tuple[Column, ...]
    course: Course

    @property
    def table(self) -> Array:
        """Shape (rows of both, columns)."""
        return np.stack([c.rows for c in self.columns], axis=1)


def libraries(case: Case) -> Iterator[Library]:
    ruleset, builder = open_builder(case.base)
    system = _system(ruleset, builder, case)
    n = len(case.course.time) - len(case.train)
    for name, shown in case.shown.items():
        relation = _relation(system, name, set(case.drivers))
        if relation is None:
            continue
        factor = ruleset.signal_by_id[name].factor
        predictor = predictor_of(system, relation, name)
        known = np.where(shown, case.train.values[name], np.nan)
        measured = np.concatenate([known, np.full(n, np.nan)]) / factor
        predicted = predictor.predicted(Configuration()) / factor
        course = replace(case.course, signal=name, measured=measured, recalibrated=predicted)
        size = rms(course.residual[course.learnt])
        found = [
            Column(rows / factor, (Cause(c.name, (f"{c.module}.{c.place}",)),))
            for c, rows in _candidates(system, predictor)
            if rms(rows[course.learnt]) > limits.SHOWN * size * factor
        ]
        if found:
            yield Library(tuple(_told_apart(found, course)), course)


def _system(ruleset: Ruleset, builder: ModelBuilder, case: Case) -> System:
    """A plant with every row of both simulations as a point, settled or not, the test held out.

    What is predicted is as simulated: a predictor begins at the reading, and stays there where a
    law has no value, so that a measured one would be handed on to who may not see it.
    """
    train, test = case.simulated
    heldout = case.course.heldout
    clock = np.concatenate([part.time - part.time[0] for part in case.simulated])
    both = Recording(
        time=clock + heldout * (clock.max() + train.interval),
        values={name: np.append(v, test.values[name]) for name, v in train.values.items()},
        segment=heldout.astype(int),
        missing=train.missing,
        notes=(),
    )
    stretches = each_row(both)
    points = points_of_stretches(both, ruleset, stretches, noise_at_work(train, ruleset))
    noise = {
        name: np.maximum(points.statistical(name), STATISTICAL_SHARE * points.systematic[name])
        for name in points.values
    }
    none = np.zeros(len(both), dtype=np.intp)
    data = Data(
        points=points,
        time=both.time,
        noise=noise,
        block=none,
        part=np.where(heldout, HELDOUT, ESTIMATION),
        of_rows=True,
        split="",
        digest="",
        moving={},
        stretches=stretches,
        sample=np.arange(len(both), dtype=np.intp),
        source=none,
        sources=(),
        clock=clock,
        timed=case.train.one_clock,
    )
    return system_of(ruleset, builder, data)


def _relation(system: System, signal: str, given: set[str]) -> str | None:
    """The residual that tells a reading by what is given, or by as little else as can be."""
    found = {}
    for spec in system.ruleset.residuals:
        ids = [term.observer for term in spec.terms]
        read = {s for o in ids for s in system.ruleset.observer_by_id[o].signals}
        if signal in read and all(o in system.number for o in ids):
            found[spec.id] = len(read - given)
    return min(found, key=lambda name: found[name], default=None)


def _candidates(system: System, predictor: Predictor) -> Iterator[tuple[Candidate, Array]]:
    """Candidates, each amplitude at its usual size and each shape, with what they move, SI."""
    for candidate in system.candidates:
        amplitudes = [u for u in candidate.unknowns if u.null is not None and not u.fixed]
        if not amplitudes or not has_drivers(system, candidate):
            continue
        null = {u.id: u.null or 0.0 for u in amplitudes}
        fixed = references(system, candidate)
        for shape in starts(system, candidate):
            for unknown in amplitudes:
                size = size_of(unknown, lambda u=unknown, c=candidate: share_of(system, c, u))
                step = size.usual or size.scale
                ends = np.clip(
                    [null[unknown.id] + step, null[unknown.id] - step],
                    unknown.lowest,
                    unknown.highest,
                )
                # To the side on which it has more room.
                at = float(max(ends, key=lambda end: abs(end - null[unknown.id])))
                values = {**null, **shape, unknown.id: at}
                setting = Configuration().joining(candidate, values, fixed)
                yield candidate, _moved(predictor, setting)


def _moved(predictor: Predictor, setting: Configuration) -> Array:
    """By how much a reading moves, shape (n,), SI; 0 where a law has no value."""
    with np.errstate(all="ignore"):
        change = predictor.predicted(setting) - predictor.predicted(Configuration())
    return np.nan_to_num(change, posinf=0.0, neginf=0.0)


def _told_apart(columns: Sequence[Column], course: Course) -> list[Column]:
    """Columns with those that point the same way put together."""
    kept: list[Column] = []
    units: list[Array] = []
    for column in columns:
        rows = column.rows[course.learnt]
        unit = rows / np.linalg.norm(rows)
        alike = [i for i, other in enumerate(units) if abs(unit @ other) > SAME_PATTERN]
        if alike:
            first = kept[alike[0]]
            causes = tuple(dict.fromkeys((*first.causes, *column.causes)))
            kept[alike[0]] = replace(first, causes=causes)
        else:
            kept.append(column)
            units.append(unit)
    return kept
