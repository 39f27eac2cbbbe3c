"""What may be written of an explanation, fitted alone: a plant file holds nothing else.

Faults, errors of sensors and courses in time are left out before the fit, not behind it: values
that were fitted beside them are those of another model. Points in periods of faults are set aside,
and sensors read as they are: whoever uses the plant reads the same ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.observe import check_readings
from rulec_runtime.recordings.header import Header
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.simulation.equations import SimulationRefused
from rulec_runtime.simulation.predict import predict

from rulec.effects.adopt import why_not
from rulec.effects.candidate import Unwritable
from rulec.mismatch.answer.public import Plants, fit_of, plants_of
from rulec.mismatch.evidence.steady.configuration import ERROR, HIDDEN, Setting
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.locate import noise_scale
from rulec.mismatch.evidence.steady.predict import Predictor
from rulec.mismatch.evidence.steady.prepare import HELDOUT
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.inference.prove import Proof, rms
from rulec.mismatch.inference.series import Predicted, course_of
from rulec.mismatch.inference.settle import repair_of
from rulec.mismatch.result import Fit, Repair, Series

_NOWHERE = Path("settled points")

UNDRIVEN = "what drives it is not recorded"

MOST = 4
"""Readings whose errors are told where nothing says which."""

KEPT = 0.25
"""Share of the points that periods of faults must leave, or they are not set aside."""


@dataclass(frozen=True)
class Writable:
    """The recalibrated and the repaired model as they are written, and what was left out.

    `used` flags points outside of periods of faults, shape (n,).
    """

    plain: Fitted
    fitted: Fitted
    left_out: tuple[tuple[str, str], ...]
    used: np.ndarray

    @property
    def repairs(self) -> tuple[Repair, Repair]:
        """What to write for each."""
        return repair_of(self.plain), repair_of(self.fitted)


def writable(settled: Fitted, faulty: np.ndarray) -> Writable:
    """Refit what may be written, and the plain model; `faulty` flags points, shape (n,)."""
    setting, builder = settled.setting, settled.rows.system.builder
    left = []
    for candidate in setting.joined:
        reason = UNDRIVEN if candidate.sort == HIDDEN else why_not(candidate, builder.network)
        if reason:
            left.append((candidate.id, reason))
            setting = setting.leaving(candidate.id)
    open_ = settled.rows.system.data.open
    clear = ~faulty if (open_ & ~faulty).sum() >= KEPT * open_.sum() else np.ones_like(faulty)
    used = settled.used & clear
    bare = setting
    for candidate in setting.joined:
        bare = bare.leaving(candidate.id)
    plain = _refitted(settled, [bare.calibrated(), Setting()], used)
    if not setting.joined:
        return Writable(plain, plain, tuple(left), clear)
    moved = replace(setting, values={**setting.values, **plain.setting.values})
    fitted = _refitted(settled, [setting, moved], used)
    return Writable(plain, fitted, tuple(left), clear)


def _refitted(settled: Fitted, starts: Sequence[Setting], used: np.ndarray) -> Fitted:
    rows: Rows = settled.rows
    none = {ERROR + name: 0.0 for name in rows.system.shared}
    found = [fit(rows, s, used, held=none, temper=settled.temper) for s in starts]
    return min(found, key=lambda f: f.objective)


@dataclass(frozen=True)
class Told:
    """Errors of the three plants, their courses, and what was simulated.

    `plants` is None where the plant cannot be simulated, which `note` tells.
    """

    fits: tuple[Fit, ...]
    series: Series
    curves: Mapping[str, Predicted]
    plants: Plants | None
    note: str = ""


def told(
    recording: Recording,
    model: Writable,
    predictors: Sequence[Predictor],
    proofs: Sequence[Proof],
    repairs: tuple[Repair, Repair],
) -> Told:
    """Simulate the plants over the recording, and compare their means at settled points."""
    system = model.fitted.rows.system
    try:
        plants = plants_of(system.ruleset, system.builder, recording, *repairs)
        note = ""
    except (SimulationRefused, Unwritable) as error:
        plants, note = None, f"errors are those of relations solved for the reading: {error}"
    by_signal: dict[str, Predicted] = {}
    if plants is not None:
        for name in _signals(plants, system, predictors):
            tables = (plants.shipped, plants.recalibrated, plants.last)
            by_signal[name] = Predicted(*(_at_points(recording, system, name, t) for t in tables))
    relations = {}
    for predictor in predictors if not by_signal else ():
        settings = (Setting(), model.plain.setting, model.fitted.setting)
        by_signal[predictor.signal.id] = Predicted(*(predictor.predicted(s) for s in settings))
        relations[predictor.signal.id] = predictor.residual.id
    if plants is not None and relations:
        note = "errors are those of relations solved for the reading: simulation takes it as given"
    explained = {p.fit.signal: p.fit for p in proofs}
    scale = noise_scale(model.fitted.rows, model.fitted.residual)
    fits, courses = [], []
    for name, predicted in by_signal.items():
        signal, measured = system.ruleset.signal_by_id[name], system.data.values[name]
        noise = (
            _noise(plants.rulesets[2], system, name) * scale
            if plants is not None and name not in relations
            else explained[name].heldout.noise * signal.factor
        )
        own = explained.get(name)
        usable = model.used & _works(system, name)
        parts = system.data.open & usable, (system.data.part == HELDOUT) & usable
        found = fit_of(
            signal,
            [p - measured for p in predicted],
            noise,
            parts,
            (own.estimation.repaired, own.heldout.repaired) if own else (np.nan, np.nan),
        )
        relation = relations.get(name, own.relation if own else None)
        fits.append(replace(found, relation=relation, simulated=name not in relations))
        courses.append(course_of(signal, measured, predicted))
    series = Series(system.data.time, ~system.data.open, tuple(courses))
    return Told(tuple(fits), series, by_signal, plants, note)


def _signals(plants: Plants, system: System, predictors: Sequence[Predictor]) -> list[str]:
    """Readings to tell errors of: those asked for, else all that are measured of their modules."""
    values = system.data.values
    there = [n for n in plants.signals if n in values and np.isfinite(values[n]).any()]
    asked = [p.signal.id for p in predictors]
    modules = {name.partition(".")[0] for name in asked}
    near = [n for n in there if n.partition(".")[0] in modules]
    return [n for n in asked if n in there] or near[:MOST] or there[:MOST]


def _works(system: System, name: str) -> np.ndarray:
    """Points at which some estimate by a reading may be used: elsewhere its module stands."""
    rows = [i for i, o in enumerate(system.observers) if name in o.signals]
    works: np.ndarray = np.any(system.valid[rows], axis=0)
    return works


def _at_points(
    recording: Recording, system: System, name: str, table: Mapping[str, Array]
) -> Array:
    """A predicted reading at settled points, shape (n,), SI: the measured mean and the mean error
    of the rows behind it."""
    bad, _ = check_readings(recording, system.ruleset)
    off = np.where(bad[name], np.nan, table[name] - recording.values[name])
    sums = np.concatenate([[0.0], np.cumsum(np.nan_to_num(off))])
    counts = np.concatenate([[0], np.cumsum(np.isfinite(off))])
    first, last = system.data.stretches.first, system.data.stretches.last
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (sums[last] - sums[first]) / (counts[last] - counts[first])
    predicted: Array = system.data.values[name] + mean
    return predicted


def _noise(ruleset: Ruleset, system: System, name: str) -> float:
    """Standard uncertainty of measured less simulated by the noise of all readings, SI."""
    data = system.data
    table = dict(data.values)
    file = RecordingFile(
        path=_NOWHERE, header=Header(), time=data.time, values=table, zones=None, comma=False
    )
    plain = predict(ruleset, [file])
    variance = data.noise[name] ** 2
    for given in plain.given:
        if given in data.noise:
            moved = {**table, given: table[given] + np.nan_to_num(data.noise[given])}
            course = predict(ruleset, [replace(file, values=moved)]).values[name]
            variance = variance + np.nan_to_num(course - plain.values[name]) ** 2
    known = np.isfinite(variance)
    return rms(np.sqrt(variance[known]))
