"""The plant: its drawing, and the numbers of its parts in the laws of `laws.yaml`. cm, s, V."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import yaml

from ..formulas import compiled

Numbers = Mapping[str, Any]
"""Numbers of a part by name."""

SENSOR = ".y"
"""Suffix of a sensor after the name of its tank."""

_TABLE: Mapping[str, Any] = yaml.safe_load(
    Path(__file__).with_name("laws.yaml").read_text(encoding="utf-8")
)


def _orifice(area: float, head: float) -> float:
    """Flow through an opening under a head."""
    if head <= 0.0 or area == 0.0:
        return 0.0
    nearly_empty: float = CONSTANTS["NEARLY_EMPTY"]
    return area * math.sqrt(2.0 * GRAVITY) * head / math.sqrt(head + nearly_empty)


# Laws are for one sample at a time, as an integrator asks for them; so they use plain numbers.
_NAMES: dict[str, Any] = {
    **{name: getattr(math, name) for name in ("exp", "sin", "sqrt", "pi")},
    **{"__builtins__": {}, "abs": abs, "max": max, "min": min, "orifice": _orifice},
}
for _name, _formula in _TABLE["constants"].items():
    _NAMES[_name] = eval(compiled(str(_formula)), _NAMES)

CONSTANTS: Mapping[str, float] = {name: _NAMES[name] for name in _TABLE["constants"]}
GRAVITY, LEVEL_ZERO = CONSTANTS["GRAVITY"], CONSTANTS["LEVEL_ZERO"]

LAWS: Mapping[str, tuple[str, str, str]] = {
    "flows": ("tank", "level, below, time, middle", "left, over, away, surface"),
    "supply": ("feed", "shown", "supply"),
    "arrival": ("feed", "flow, level, time", "fed, missed"),
}
"""Kind of part, arguments and results of each law."""


def law(name: str, numbers: Numbers) -> Callable[..., Any]:
    """Return a law of a part as a function of its arguments, which gives its results; see LAWS."""
    kind, arguments, results = LAWS[name]
    formulas = _TABLE[kind][name]
    for formula in formulas.values():
        compiled(formula)  # no more than an expression
    steps = ", ".join(f"{result} := {formula}" for result, formula in formulas.items())
    fixed = ", ".join(f"{number}={number}" for number in numbers)
    function = eval(f"lambda {arguments}, {fixed}: ({steps}, ({results}))[-1]", _NAMES, {**numbers})
    return cast(Callable[..., Any], function)


@dataclass(frozen=True)
class Layout:
    """The plant's drawing: names, measured tanks, columns.

    `metered`: the input is a flow meter, l/h, not the voltage of a pump.
    """

    name: str
    feed: str
    tanks: tuple[str, ...]
    measured: tuple[str, ...]
    metered: bool
    interval: float
    input_column: str
    columns: Mapping[str, str]


CASCADED = Layout(
    "cascaded-tanks",
    "pump",
    ("upper", "lower"),
    ("lower",),
    False,
    4.0,
    "u [V]",
    {"lower": "y [V]"},
)


@dataclass(frozen=True)
class Plant:
    """Tanks from top to bottom, of which the last one drains into the reservoir, and their feed.

    `parts` has the numbers of each part: the feed and the tanks by name, the sensor of a tank as
    `lower.y`.
    """

    layout: Layout
    parts: Mapping[str, Numbers]

    @property
    def feed(self) -> Numbers:
        """The numbers of the feed."""
        return self.parts[self.layout.feed]

    @property
    def tanks(self) -> dict[str, Numbers]:
        """The numbers of the tanks from top to bottom."""
        return {name: self.parts[name] for name in self.layout.tanks}

    @property
    def sensors(self) -> dict[str, Numbers]:
        """The numbers of the sensors by tank."""
        return {name: self.parts[f"{name}{SENSOR}"] for name in self.layout.measured}

    def with_(self, part: str, **numbers: Any) -> Plant:
        """Return the plant with other numbers of a part; what was never stated is as in the law."""
        layout = self.layout
        kind = "feed" if part == layout.feed else "tank" if part in layout.tanks else "sensor"
        own = {**_TABLE[kind]["numbers"], **self.parts.get(part, {}), **numbers}
        return replace(self, parts={**self.parts, part: own})
