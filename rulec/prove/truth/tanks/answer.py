"""The sealed answer of a case: what is planted where, with which parameters, how much it shows."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass

from ..sealed import rounded
from .effect import Values


@dataclass(frozen=True)
class Truth:
    """One planted effect.

    Attributes
    ----------
    module : a module of the plant (`upper`) or a signal (`lower.y`)
    period : seconds from and to, for what begins or ends
    shown : root mean square of what it changes alone, V, by signal
    present : share of samples where it changes a reading by more than its noise
    twins : what cannot be told from it, or hardly
    """

    effect: str
    title: str
    sort: str
    module: str
    parameters: Values
    period: tuple[float, float] | None
    shown: Mapping[str, float]
    present: float
    twins: tuple[str, ...]


@dataclass(frozen=True)
class Answer:
    """What is true of a recording.

    Attributes
    ----------
    verdict : `none`, `named`, `sensor`, `fault` or `unnamed`, as the machine form of the tool
    parameters : true base parameters, with units; names as in the plant's module types
    sensing : noise and systematic errors, with units
    shown : what all effects change together, V, by signal
    hiding : that over the root sum of squares of what each changes alone; below 1 they hide
    attempt : how often the plant was drawn before the effects showed as they should
    """

    case: str
    plant: str
    seed: int
    attempt: int
    samples: int
    interval: float
    profile: str
    verdict: str
    effects: tuple[Truth, ...]
    parameters: Values
    sensing: Values
    shown: Mapping[str, float]
    hiding: float | None

    def to_json(self) -> str:
        """As text; numbers with six digits, parameters as value and unit."""
        fields = dataclasses.asdict(self)
        for part in (fields, *fields["effects"]):
            part["parameters"] = _stated(part["parameters"])
        fields["sensing"] = _stated(fields["sensing"])
        return json.dumps(rounded(fields), indent=1, ensure_ascii=False) + "\n"

    @property
    def digest(self) -> str:
        """Hash of the text, to be shown before an analysis starts."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()


def _stated(values: Values) -> dict[str, dict[str, object]]:
    """Values as the machine form has them."""
    return {name: {"value": value, "unit": unit} for name, (value, unit) in values.items()}
