"""The repair of a plant, read from the JSON file of `rulec mismatch`."""

import hashlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset_file import built
from rulec_runtime.output.json_file import Damaged, read_json
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.formats import STANDARD_INPUT, bytes_of, is_there
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording_file import files_of

from rulec.effects.candidate import Changed, CurveTerm, Repair
from rulec.knowledge.sources import Sources


class AdoptRefused(Refusal):
    """This file cannot be adopted; the message says why and what to do."""


def why_refused(edits: Sequence[str], refused: str) -> str:
    """Why `rulec adopt` refuses to write a repair; empty if it does not.

    `edits` must first be made in the plant file, `refused` is the reason against the repair.
    """
    if not edits:
        return refused
    todo = ". ".join(f"{edit[0].upper()}{edit[1:]}" for edit in edits)
    return (
        "the plant file says otherwise than the readings what feeds what, and it is the "
        f"engineer's. {todo}. Then run rulec mismatch again"
    )


@dataclass(frozen=True)
class Basis:
    """What an analysis was made from: hashes by path of the plant's files and of the recordings,
    which were `given` in this order. Recordings `in_memory` have no path."""

    plant: Mapping[str, str]
    given: tuple[str, ...]
    recordings: Mapping[str, str]
    in_memory: bool = False


@dataclass(frozen=True)
class Reported:
    """Held-out errors of a reading, in its unit, of the recalibrated and of this plant."""

    signal: str
    unit: str
    recalibrated: float
    own: float
    points: int


@dataclass(frozen=True, kw_only=True)
class Proven:
    """What the JSON file says beside a repair; the written plant must fulfil it.

    `left_out` are ids of explanations that no model may hold, with the reason; `refused` says why
    nothing is written. `reported` are the errors shown, `checks` the errors over all held-out rows
    by signal, in its unit, in the spans `heldout`, s. `misread` says, in this order, how to read
    columns that differ from their header, `edits` what to change in the plant file first.
    """

    basis: Basis | None
    left_out: tuple[tuple[str, str], ...]
    refused: str
    reported: tuple[Reported, ...]
    checks: Mapping[str, float]
    heldout: tuple[tuple[float, float], ...]
    misread: tuple[Mending, ...] = ()
    edits: tuple[str, ...] = ()


def proven_of(data: Mapping[str, Any], file: Path, recalibrated: bool) -> Proven:
    """What a JSON file says of the repair in it, or of the `recalibrated` plant."""
    part = data["repair"]
    kind, row = ("recalibrated", "plain") if recalibrated else ("repaired", "error")
    with _sound(file):
        reported = tuple(
            Reported(
                str(fit["signal"]),
                str(fit["unit"]),
                _maybe(fit["heldout"]["recalibrated"]),
                _maybe(fit["heldout"][kind]),
                int(fit["heldout"]["points"]),
            )
            for fit in data.get("fits", ())
        )
        misread: tuple[Mending, ...] = built(tuple[Mending, ...])(part.get("misread", []))
        for one in misread:
            if not one.signals or (len(one.signals) > 2 and not one.late):
                raise ValueError(f"{len(one.signals)} columns to be read otherwise at once")
        return Proven(
            basis=built(Basis | None)(part.get("made_from")),
            left_out=tuple((str(e["id"]), str(e["reason"])) for e in part.get("left_out", ())),
            refused="" if recalibrated else str(part.get("refused") or ""),
            reported=reported,
            checks={str(c["signal"]): _number(c[row]) for c in part.get("checks", ())},
            heldout=built(_Spans)(data.get("split", {}).get("heldout", [])),
            misread=misread,
            edits=tuple(str(r["edit"]) for r in part.get("rewired", ())),
        )


_Spans = tuple[tuple[float, float], ...]


def _maybe(value: Any) -> float:
    return math.nan if value is None else float(value)


def read_form(file: Path) -> dict[str, Any]:
    """The content of a JSON file of `rulec mismatch`; raises `AdoptRefused` if it has no repair."""
    try:
        data = read_json(file)
    except Damaged as error:
        raise AdoptRefused(
            f"{file}: this is not a result of `rulec mismatch --json FILE` ({error})"
        ) from None
    if not isinstance(data, dict) or not isinstance(data.get("repair"), dict):
        raise AdoptRefused(f"{file}: there is no repair in this file; was it judged at all?")
    return data


def _broken(file: Path, error: Exception) -> AdoptRefused:
    message = f"{file}: the repair in this file is broken ({type(error).__name__}: {error})"
    return AdoptRefused(f"{message}; write it again with rulec mismatch")


@contextmanager
def _sound(file: Path) -> Iterator[None]:
    """Raise `AdoptRefused` where the content of a file has another form."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise _broken(file, error) from None


def repair_of(data: Mapping[str, Any], file: Path, recalibrated: bool = False) -> Repair:
    """The repair in the content of a JSON file, or the values of the `recalibrated` plant.

    Raises `AdoptRefused` if there is nothing to adopt.
    """
    part = data["repair"]
    if recalibrated:
        if not isinstance(part.get("recalibrated"), dict):
            raise AdoptRefused(f"{file}: it holds no recalibrated plant; run rulec mismatch again")
        part = {"joined": [], **part["recalibrated"]}
    with _sound(file):
        # The name goes into comments: no line breaks.
        name = str(data.get("recording", ""))[:200]
        return _repair("".join(c for c in name if c.isprintable()), part)


def _repair(recording: str, part: Mapping[str, Any]) -> Repair:
    names = tuple(str(name) for name in part["parameters"])
    count = len(names)
    values = [_number(v) for v in part["values"]]
    covariance = np.array(part["covariance"], dtype=float).reshape(-1, max(count, 1))[:, :count]
    if len(values) != count or covariance.shape != (count, count):
        raise ValueError(f"{count} parameters, but other numbers of values or covariances")
    if not np.all(np.isfinite(covariance)) or np.any(np.diag(covariance) < 0.0):
        raise ValueError("a variance is not a number, or below 0")
    u = np.sqrt(np.diag(covariance)).tolist()
    fixed: dict[str, float] = {}
    for entry in part["joined"]:
        entries = {**entry["unknowns"], **(entry.get("fixed") or {})}
        fixed |= {str(k): _number(v) for k, v in entries.items()}
    curves: tuple[CurveTerm, ...] = built(tuple[CurveTerm, ...])(part.get("curves") or [])
    for curve in curves:
        if len(curve.points) < 2 or any(a >= b for (a, _), (b, _) in pairwise(curve.points)):
            raise ValueError("the points of a curve do not go up")
    return Repair(
        joined=tuple(str(entry["id"]) for entry in part["joined"]),
        parameters=tuple(map(Changed, names, values, u)),
        covariance=covariance,
        fixed=fixed,
        misfit=built(Mapping[str, float])(part.get("misfit") or {}),
        ranges=built(Mapping[str, tuple[float, float]])(part.get("range") or {}),
        curves=curves,
        recording=recording,
    )


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is not a number")
    return number


def plant_of(data: Mapping[str, Any], file: Path) -> Path:
    """The plant of a repair, by its name relative to the working folder, or to the file.

    Raises `AdoptRefused` if it is not there.
    """
    name = data["repair"].get("plant")
    if not isinstance(name, str):
        raise _broken(file, KeyError("plant"))
    for path in (Path(name), file.parent / name):
        if path.exists():
            return path
    raise AdoptRefused(f"{file}: there is no plant '{name}'; run this where rulec mismatch ran")


AGAIN = "run rulec mismatch again"


def basis_of(
    sources: Sources, recordings: Sequence[Path], in_memory: bool = False
) -> dict[str, Any]:
    """Hashes by path of the plant's files, the whole knowledge base and the recordings.

    Paths are absolute, so that `rulec adopt` finds them from any folder. `in_memory`: some
    recordings have no path.
    """
    return {
        "plant": _hashes(_plant_files(sources)),
        "given": [_real(recording) for recording in recordings],
        "recordings": _hashes(_files(recordings)),
        **({"in_memory": True} if in_memory else {}),
    }


def check_unchanged(basis: Basis, sources: Sources) -> list[Path]:
    """The recordings in the order given; raises `AdoptRefused` if anything has changed."""
    if basis.in_memory:
        raise AdoptRefused(
            "a recording was in memory, and it must be read again; give the result of "
            f"rulec.mismatch itself, or write the recording to a file and {AGAIN}"
        )
    check_plant_unchanged(basis, sources)
    recordings = [Path(recording) for recording in basis.given]
    for recording in recordings:
        if recording.name == STANDARD_INPUT.name:
            raise AdoptRefused(
                "the recording came from standard input, and it must be read again; keep it in a "
                "file, and run rulec mismatch with that"
            )
        if not is_there(recording):
            raise AdoptRefused(
                f"the recording '{recording}' is not there any more, and it must be read again; "
                f"put it back, or {AGAIN}"
            )
    _compare("recording", basis.recordings, _hashes(_files(recordings)))
    return recordings


def check_plant_unchanged(basis: Basis, sources: Sources) -> None:
    """Raises `AdoptRefused` if a file of the plant has changed since the analysis."""
    _compare("plant", basis.plant, _hashes(_plant_files(sources)))


def _files(recordings: Iterable[Path]) -> list[Path]:
    return [file for recording in recordings for file in files_of(recording)]


def _compare(what: str, then: Mapping[str, str], now: Mapping[str, str]) -> None:
    if then == now:
        return
    other = sorted(name for name in then.keys() | now.keys() if then.get(name) != now.get(name))
    name = other[0]
    happened = "is gone" if name not in now else "is new" if name not in then else "has changed"
    more = f" (and {len(other) - 1} other files)" if len(other) > 1 else ""
    raise AdoptRefused(
        f"'{name}'{more} {happened} since the analysis; what was found may not hold for this "
        f"{what}. Put it back as it was, or {AGAIN}"
    )


def _plant_files(sources: Sources) -> Iterator[Path]:
    assert sources.plant is not None
    file = Path(sources.plant.path)
    yield file
    data = sources.plant.data
    names = [data.get("columns"), data.get("adjacency"), *data.get("calibration", ())]
    yield from (file.parent / name for name in names if name)
    for layer in sources.layers:
        yield from layer.files


def _hashes(files: Iterator[Path] | list[Path]) -> dict[str, str]:
    return {_real(file): hashlib.sha256(bytes_of(file)).hexdigest() for file in files}


def _real(file: Path) -> str:
    """The real path; `Path.resolve` would raise on a link to itself."""
    return Path(os.path.realpath(file)).as_posix()
