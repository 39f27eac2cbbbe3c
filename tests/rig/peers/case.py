"""A rig as peers see it: the recalibrated prediction, its residual in training, and the inputs."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.passes.pipeline import compile_plant
from rulec.prove.real.rig_folder import PLANT, Rig
from rulec.prove.real.run_tool import ASKED, FOLDERS, NOTHING, Commands, off_of
from rulec.prove.real.score import Scored, scored
from tests.rig.peers import limits
from tests.rig.peers.sparse import Array, Course, rms


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
