"""What the analysis of a mismatch wants changed in a plant: read from its machine form."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.json_file import Damaged, read_json
from runtime.plan import Array


class AdoptRefused(Exception):
    """This file cannot be adopted; the message says why and what to do."""


@dataclass(frozen=True)
class Joined:
    """A candidate that was accepted, with the values of its unknowns by id, SI."""

    id: str
    values: Mapping[str, float]


@dataclass(frozen=True)
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


def read_repair(file: Path) -> Repair:
    """Read the machine form of a mismatch; raises `AdoptRefused` where it says nothing to adopt."""
    try:
        data = read_json(file)
    except Damaged as error:
        message = f"{file}: this is not JSON ({error}); write it with rulec mismatch"
        raise AdoptRefused(message) from None
    part = data.get("repair") if isinstance(data, dict) else None
    if not isinstance(part, dict):
        raise AdoptRefused(f"{file}: there is no repair in this file; was it judged at all?")
    try:
        return _repair(file, _in_one_line(data.get("recording", "")), part)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        message = f"{file}: the repair in this file is broken ({type(error).__name__}: {error})"
        raise AdoptRefused(f"{message}; write it again with rulec mismatch") from None


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
        _plant(file, str(part["plant"])),
        recording,
        tuple(_joined(entry) for entry in part["joined"]),
        names,
        values,
        covariance,
        {str(k): _number(v) for k, v in (part.get("misfit") or {}).items()},
        {str(k): (_number(v[0]), _number(v[1])) for k, v in (part.get("range") or {}).items()},
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
