"""The repair of a plant, read from the JSON file of `rulec mismatch`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.json_file import Damaged, read_json
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.mending import Mending


class AdoptRefused(Refusal):
    """This file cannot be adopted; the message says why and what to do."""


def why_refused(edits: Sequence[str], refused: str) -> str:
    """Why `rulec adopt` writes no repair; empty where it does. What it refuses is not proven.

    `edits` are to be made in the plant file first, `refused` is what speaks against the repair.
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
    """What an analysis was made from: hashes by path, of the plant's files and of recordings, which
    were `given` in this order. Recordings `in_memory` have no path."""

    plant: Mapping[str, str]
    given: tuple[str, ...]
    recordings: Mapping[str, str]
    in_memory: bool = False


@dataclass(frozen=True)
class Reported:
    """Held-out errors of a reading, in its unit, of the recalibrated plant and of this one."""

    signal: str
    unit: str
    recalibrated: float
    own: float
    points: int


@dataclass(frozen=True)
class Joined:
    """A candidate that was accepted, with the values of its unknowns by id, SI."""

    id: str
    values: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Repair:
    """A repaired model, SI.

    `parameters` are ids of plan inputs with their `values`, shape (n,), and joint `covariance`,
    shape (n, n); those that the candidates brought in may stand among them. `misfit` is per
    observer, `ranges` per signal what the recording covered.
    """

    plant: Path
    recording: str
    joined: tuple[Joined, ...]
    parameters: tuple[str, ...]
    values: Array
    covariance: Array
    misfit: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Proven:
    """What the JSON file says beside a repair, which the written plant must fulfil.

    `left_out` are ids of explanations that no model may hold, with the reason; `refused` says why
    nothing is written. `reported` are the errors that were shown, `checks` those over all held-out
    rows by signal, in its unit, in the spans `heldout`, s. `misread` says how columns must be read
    that are not what their header says, in this order, `edits` what to change in the plant file
    before all this holds.
    """

    basis: Basis | None
    left_out: tuple[tuple[str, str], ...]
    refused: str
    reported: tuple[Reported, ...]
    checks: Mapping[str, float]
    heldout: tuple[tuple[float, float], ...]
    misread: tuple[Mending, ...] = ()
    edits: tuple[str, ...] = ()


def proven_of(data: Mapping[str, Any], file: Path, recalibrated: bool = False) -> Proven:
    """What the content of a JSON file says of the repair in it, or of the `recalibrated` plant."""
    part = data["repair"]
    try:
        kind, row = ("recalibrated", "plain") if recalibrated else ("repaired", "error")
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
        checks = {str(c["signal"]): _number(c[row]) for c in part.get("checks", ())}
        basis = part.get("made_from")
        return Proven(
            basis=None if basis is None else _basis(basis),
            left_out=tuple((str(e["id"]), str(e["reason"])) for e in part.get("left_out", ())),
            refused="" if recalibrated else str(part.get("refused") or ""),
            reported=reported,
            checks=checks,
            heldout=tuple(
                (_number(a), _number(b)) for a, b in data.get("split", {}).get("heldout", ())
            ),
            misread=tuple(_mending(m) for m in part.get("misread", ())),
            edits=tuple(str(r["edit"]) for r in part.get("rewired", ())),
        )
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise _broken(file, error) from None


def _mending(data: Mapping[str, Any]) -> Mending:
    signals = tuple(str(name) for name in data["signals"])
    late = _number(data.get("late", 0.0))
    if not signals or (len(signals) > 2 and not late):
        raise ValueError(f"{len(signals)} columns to be read otherwise at once")
    return Mending(
        signals=signals,
        factor=_number(data["factor"]),
        offset=_number(data["offset"]),
        late=late,
    )


def _basis(data: Mapping[str, Any]) -> Basis:
    return Basis(
        {str(k): str(v) for k, v in data["plant"].items()},
        tuple(str(path) for path in data["given"]),
        {str(k): str(v) for k, v in data["recordings"].items()},
        bool(data.get("in_memory", False)),
    )


def _maybe(value: Any) -> float:
    return math.nan if value is None else float(value)


def read_form(file: Path) -> dict[str, Any]:
    """Content of a JSON file of `rulec mismatch`; raises `AdoptRefused` where it has no repair."""
    try:
        data = read_json(file)
    except Damaged as error:
        message = f"{file}: {error}; write it with rulec mismatch"
        raise AdoptRefused(message) from None
    if not isinstance(data, dict) or not isinstance(data.get("repair"), dict):
        raise AdoptRefused(f"{file}: there is no repair in this file; was it judged at all?")
    return data


def _broken(file: Path, error: Exception) -> AdoptRefused:
    message = f"{file}: the repair in this file is broken ({type(error).__name__}: {error})"
    return AdoptRefused(f"{message}; write it again with rulec mismatch")


def repair_of(data: Mapping[str, Any], file: Path, recalibrated: bool = False) -> Repair:
    """The repair in the content of a JSON file, or the values of the `recalibrated` plant.

    Raises `AdoptRefused` where there is nothing to adopt.
    """
    part = data["repair"]
    if recalibrated:
        if not isinstance(part.get("recalibrated"), dict):
            raise AdoptRefused(f"{file}: it holds no recalibrated plant; run rulec mismatch again")
        part = {"plant": part.get("plant"), "joined": [], **part["recalibrated"]}
    try:
        return _repair(file, _in_one_line(data.get("recording", "")), part)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise _broken(file, error) from None


def _repair(file: Path, recording: str, part: Mapping[str, Any]) -> Repair:
    names = tuple(str(name) for name in part["parameters"])
    count = len(names)
    values = np.array([_number(v) for v in part["values"]], dtype=float)
    covariance = np.array(part["covariance"], dtype=float).reshape(-1, max(count, 1))[:, :count]
    if values.shape != (count,) or covariance.shape != (count, count):
        raise ValueError(f"{count} parameters, but other numbers of values or covariances")
    if not np.all(np.isfinite(covariance)) or np.any(np.diag(covariance) < 0.0):
        raise ValueError("a variance is not a number, or below 0")
    return Repair(
        plant=_plant(file, str(part["plant"])),
        recording=recording,
        joined=tuple(_joined(entry) for entry in part["joined"]),
        parameters=names,
        values=values,
        covariance=covariance,
        misfit={str(k): _number(v) for k, v in (part.get("misfit") or {}).items()},
        ranges={
            str(k): (_number(v[0]), _number(v[1])) for k, v in (part.get("range") or {}).items()
        },
    )


def _in_one_line(name: Any) -> str:
    """A file's name as it may stand in a comment; what cannot be read is left out."""
    return "".join(c for c in str(name)[:200] if c.isprintable())


def _joined(entry: Mapping[str, Any]) -> Joined:
    values = {**entry["unknowns"], **(entry.get("fixed") or {})}
    return Joined(str(entry["id"]), {str(k): _number(v) for k, v in values.items()})


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is not a number")
    return number


def _plant(file: Path, name: str) -> Path:
    """The plant as named from here, or as seen from the file."""
    for path in (Path(name), file.parent / name):
        if path.exists():
            return path
    raise AdoptRefused(f"{file}: there is no plant '{name}'; run this where rulec mismatch ran")
