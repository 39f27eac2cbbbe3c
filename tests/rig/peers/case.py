"""A rig as peers see it: the recalibrated prediction, its residual in training, and the inputs."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.points import points_of_stretches
from rulec_runtime.recordings.point_table import each_row
from rulec_runtime.recordings.recording import Recording, read_recording
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
from rulec.passes.pipeline import compile_plant
from rulec.prove.real.rig_folder import PLANT, Rig
from rulec.prove.real.run_tool import ASKED, FOLDERS, NOTHING, Commands, off_of
from rulec.prove.real.score import Cause, Scored, scored
from tests.bench.peers.structural import PEER, structure_of
from tests.rig.peers import limits
from tests.rig.peers.learnt import Array, Course, evenly, rms, stlsq


@dataclass(frozen=True, kw_only=True)
class Case:
    """A rig and what is given to peers.

    Attributes
    ----------
    base : the plant that is corrected, as recalibrated, else as shipped.
    simulated : its predictions of training and test, beside what they are given.
    course : the reading that counts over the rows of training and, flagged as held out, of the
        test, where `measured` is NaN; in its unit.
    drivers : readings that a simulation takes as given, shape (rows of both,), SI.
    off : by model, simulated less measured on the test rows, in the unit of the reading.
    judged : test rows that all our plants predict.
    shown : by reading, rows of training with a residual.
    left : by reading, root mean square residual of training, in its unit.
    """

    scored: Scored
    rules: Ruleset
    base: Path
    train: Recording
    simulated: tuple[Recording, Recording]
    course: Course
    drivers: Mapping[str, Array]
    off: Mapping[str, Array]
    judged: NDArray[np.bool_]
    shown: Mapping[str, NDArray[np.bool_]]
    left: Mapping[str, float]

    @property
    def stores(self) -> bool:
        return self.rules.dynamics is not None

    @property
    def inputs(self) -> Mapping[str, Array]:
        """What peers that learn get: of a plant that stores, also earlier and the prediction."""
        if not self.stores:
            return self.drivers
        every = {**self.drivers, "predicted": self.course.recalibrated}
        return lagged(every, self.course.heldout)

    def error(self, correction: Array) -> float:
        """Root mean square error on unseen rows with a correction, shape (rows of both,)."""
        mended = self.off["recalibrated"] + correction[self.course.heldout]
        return rms(mended[self.judged])


def case_of(rig: Rig, folder: Path, work: Path) -> Case | None:
    """Read what was kept; `work` keeps the prediction of training. None without one of ours."""
    asked = {**NOTHING, **json.loads((folder / ASKED).read_text(encoding="utf-8"))}
    ours = scored(rig, asked)
    if not ours.signal:
        return None
    there = {m: folder / f for m, f in FOLDERS.items() if (folder / f / PLANT).is_file()}
    base = "recalibrated" if "recalibrated" in there else "shipped"
    rules = compile_plant(there["shipped"] / PLANT)
    files = next(folder.glob("train-1.csv*")), next(folder.glob("test.csv*"))
    train, test = (read_recording(file, rules) for file in files)
    simulated = _simulated(there[base], files[0], work)
    seen = off_of(rules, simulated, train)
    off = {m: off_of(rules, folder / f"{m}.csv", test)[ours.signal] for m in there}
    off.setdefault("recalibrated", off["shipped"])
    off.setdefault("adopted", off["recalibrated"])
    predicted = read_recording(simulated, rules), read_recording(folder / f"{base}.csv", rules)
    return Case(
        scored=ours,
        rules=rules,
        base=there[base],
        train=train,
        simulated=predicted,
        course=_course(ours.signal, rules, (train, test), predicted, seen[ours.signal]),
        drivers=_drivers(rules, (train, test), predicted[0]),
        off=off,
        judged=np.all([np.isfinite(o) for o in off.values()], axis=0),
        shown={name: np.isfinite(o) for name, o in seen.items() if name in ours.predicted},
        left={name: rms(o[np.isfinite(o)]) for name, o in seen.items() if np.isfinite(o).any()},
    )


def _simulated(plant: Path, train: Path, work: Path) -> Path:
    """The base plant's prediction of the training recording, made once."""
    target = work / f"{plant.parent.name}-train.csv"
    if not target.is_file():
        command = "simulate", plant.absolute(), train.absolute(), "-o", target.absolute()
        Commands(work, limits.PATIENCE).run(*command, "--quiet")
    return target


def _course(
    signal: str,
    rules: Ruleset,
    recorded: tuple[Recording, Recording],
    simulated: tuple[Recording, Recording],
    off: Array,
) -> Course:
    factor = rules.signal_by_id[signal].factor
    base = np.concatenate([s.values[signal] for s in simulated]) / factor
    n, m = map(len, recorded)
    measured = np.concatenate([base[:n] - off, np.full(m, np.nan)])
    time = np.concatenate([r.time for r in recorded])
    return Course(signal, time, np.arange(n + m) >= n, measured, base)


def _drivers(
    rules: Ruleset, recorded: tuple[Recording, Recording], simulated: Recording
) -> dict[str, Array]:
    """Readings that come out of a simulation as they went in."""
    train = recorded[0].values
    given = [
        s.id
        for s in rules.signals
        if s.id in train
        and s.id in simulated.values
        and np.isfinite(train[s.id]).any()
        and np.allclose(simulated.values[s.id], train[s.id], rtol=1e-6, equal_nan=True)
    ]
    return {name: np.concatenate([r.values[name] for r in recorded]) for name in given}


def lagged(columns: Mapping[str, Array], heldout: NDArray[np.bool_]) -> dict[str, Array]:
    """Columns with delays; before the first sample of its recording each has the value there."""
    start = np.where(heldout, np.argmax(heldout), 0)
    longest = limits.LAG_SHARE * int((~heldout).sum())
    lags = np.round(np.linspace(0.0, longest, limits.LAGS)).astype(int)
    at = np.arange(len(heldout))
    return {
        f"{name} {lag} ago": values[np.maximum(at - lag, start)]
        for name, values in columns.items()
        for lag in lags.tolist()
    }


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


def chosen(library: Library) -> Array:
    """Weight of each column of a library, shape (columns,)."""
    course = library.course
    rows = evenly(course.learnt, limits.LIBRARY_ROWS)
    return stlsq(library.table[rows], course.residual[rows], course.folds[rows])


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
        recorded = np.where(shown, case.train.values[name], np.nan)
        measured = np.concatenate([recorded, np.full(n, np.nan)]) / factor
        predicted = predictor.predicted(Configuration()) / factor
        course = replace(case.course, signal=name, measured=measured, recalibrated=predicted)
        size = rms(course.residual[course.learnt])
        found = [
            Column(rows / factor, (Cause(c.name, (f"{c.module}.{c.place}",)),))
            for c, rows in _candidates(system, predictor)
            if rms(rows[course.learnt]) > limits.SHOWN * size * factor
        ]
        if found:
            yield Library(tuple(_uncorrelated(found, course)), course)


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
        rounding={},
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


def _uncorrelated(columns: Sequence[Column], course: Course) -> list[Column]:
    """Columns with those that point the same way put together."""
    merged: list[Column] = []
    units: list[Array] = []
    for column in columns:
        rows = column.rows[course.learnt]
        unit = rows / np.linalg.norm(rows)
        alike = [i for i, other in enumerate(units) if abs(unit @ other) > SAME_PATTERN]
        if alike:
            first = merged[alike[0]]
            causes = tuple(dict.fromkeys((*first.causes, *column.causes)))
            merged[alike[0]] = replace(first, causes=causes)
        else:
            merged.append(column)
            units.append(unit)
    return merged


def located(case: Case) -> tuple[tuple[str, ...], int] | None:
    """Places in all sets that fire, as `module.place`, all of them where none fires; and how many
    there are. None where the toolbox is not there, the plant stores, or no set tells a reading."""
    if find_spec(PEER) is None or case.stores:
        return None
    ruleset, builder = open_builder(case.base)
    system, locations = _system(ruleset, builder, case), builder.locations
    acting = {location.id: location.observers for location in locations}
    model = structure_of(case.rules, acting)
    observers = {i: o.id for i, o in enumerate(case.rules.observers)}
    sets = model.MSO()
    signature = np.asarray(model.FSM(sets), dtype=bool)
    of = {frozenset(observers[i] for i in s if i in observers): k for k, s in enumerate(sets)}
    fired, asked = np.ones(len(locations), dtype=bool), 0
    for name in case.shown:
        relation = _relation(system, name, set(case.drivers))
        spec = next((r for r in ruleset.residuals if r.id == relation), None)
        noise = case.scored.noise.get(name)
        number = of.get(frozenset(t.observer for t in spec.terms)) if spec else None
        if number is None or not noise:
            continue
        asked += 1
        if case.left[name] > limits.FIRES * noise:
            fired &= signature[number]
    names = [f"{s.module}.{s.place}" for s in locations]
    open_ = dict.fromkeys(p for p, own in zip(names, fired, strict=True) if own)
    return (tuple(open_), len(set(names))) if asked else None
