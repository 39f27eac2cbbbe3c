"""The common form of all cases of the proof, and their sealed answers.

An answer is the report of a perfect analysis. It is text, so that its hash can be shown before an
analysis starts.
"""

import dataclasses
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Planted:
    """One thing that the plain model leaves out.

    Attributes
    ----------
    effect, title, sort : names in the truth; sort is `physics`, `fault`, `sensor` or `unnamed`
    module, place : its position on the plant's drawing
    names : right entries of the catalogue; empty if no entry names it
    places : right `module.place`, as in the tool's JSON
    parameters : true values by entry and parameter, in the unit of the entry; those without an
        exact counterpart are left out
    gain : strength: expected gain in log likelihood of a model with the effect over one without,
        both refitted (parameters and sensors' errors within their uncertainties), all else known
    """

    effect: str
    title: str
    sort: str
    module: str
    place: str
    names: tuple[str, ...]
    places: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, float]]
    gain: float


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The truth of a case.

    Attributes
    ----------
    case : unique name
    half : `stationary` or `dynamic`
    plant, profile : names of the plant and of its operation
    verdict : `none`, `named`, `sensor`, `fault` or `unnamed`, as in the tool's JSON
    unrecorded : signal that drives an effect and is missing in the recording, or empty
    difficulties : of `cases.yaml`, sizes by law or sensor
    """

    case: str
    half: str
    plant: str
    profile: str
    seed: int
    samples: int
    verdict: str
    effects: tuple[Planted, ...] = ()
    unrecorded: str = ""
    difficulties: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return the answer as text; numbers have six digits."""
        fields = dataclasses.asdict(self)
        if not self.difficulties:
            del fields["difficulties"]
        rounded = plain_form(fields, lambda value: float(f"{value:.6g}"))
        return json.dumps(rounded, indent=1, ensure_ascii=False) + "\n"

    @property
    def digest(self) -> str:
        """Hash of the text, to be shown before an analysis starts."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()


HIDES = 0.8
"""Effects hide each other if together they change less than this share of their root sum of
squares."""


class Case(Protocol):
    """A simulated case."""

    @property
    def answer(self) -> Answer:
        """The sealed answer."""

    def write(self, folder: Path) -> None:
        """Write `plant/` and `recording.csv`, all that the analysis gets."""


def verdict_of(sorts: list[str]) -> str:
    """Return the verdict of a perfect analysis."""
    if not sorts:
        return "none"
    if "unnamed" in sorts:
        return "unnamed"
    for only in ("sensor", "fault"):
        if set(sorts) == {only}:
            return only
    return "named" if "physics" in sorts else "fault"


def plain_form(value: object, number: Callable[[float], float]) -> object:
    """Apply a function to all floats, in any nesting; infinite and undefined ones become text."""
    match value:
        case float():
            return number(value) if np.isfinite(value) else str(value)
        case dict():
            return {key: plain_form(inner, number) for key, inner in value.items()}
        case list() | tuple():
            return [plain_form(inner, number) for inner in value]
        case _:
            return value
