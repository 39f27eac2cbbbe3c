"""What a plant does beyond its plain laws: terms that are added where they act."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..units import Array

Kind = Literal["slip", "gain", "head", "loss", "power", "shaft", "leak", "friction"]
"""Where a term acts: `slip` m3/s that the pump does not deliver, `gain` share of the delivered flow
that is lost, `head` Pa that a centrifugal pump does not give, `loss` Pa of a line or mixer, `power`
W at the motor, `shaft` share of the shown speed that the shaft does not turn, `leak` share of the
pump's flow that returns, `friction` share by which the friction of a line or mixer is raised."""


@dataclass(frozen=True)
class State:
    """Operating point of one module or mixer; arrays of shape (n,).

    Attributes
    ----------
    speed : of the shaft, rev/s
    flow : net flow, m3/s
    pressure : across the pump, or behind a line, Pa
    power : of the plain law, W; free of it where the law has no pressure: `idle`, W
    slip : of the plain law driven by pressure, m3/s
    """

    speed: Array
    flow: Array
    pressure: Array
    power: Array
    idle: Array
    slip: Array


Law = Callable[[State], Array]


@dataclass(frozen=True)
class Term:
    """A law that is added in a module or mixer."""

    kind: Kind
    module: str
    law: Law


@dataclass(frozen=True)
class Reading:
    """What a sensor shows of what is there, both SI, shape (n,); `place` such as `A.dp`."""

    place: str
    shown: Callable[[Array], Array]


@dataclass(frozen=True)
class Column:
    """What stands in the column of `place` in the file, of what all columns should hold, each shape
    (n,); their noise is in them. Scales of units have no part in it."""

    place: str
    written: Callable[[Mapping[str, Array]], Array]


Change = Term | Reading | Column


def total(terms: Iterable[Change], kind: Kind, module: str, state: State) -> Array | float:
    """Sum of all terms of a kind in a module."""
    found = [
        t.law(state) for t in terms if isinstance(t, Term) and t.kind == kind and t.module == module
    ]
    return np.sum(found, axis=0) if found else 0.0


def written_by(terms: Sequence[Change], columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns as they stand in the file, by place."""
    wrong = {t.place: t.written(columns) for t in terms if isinstance(t, Column)}
    return {**columns, **wrong}


def shown_by(terms: Sequence[Change], place: str, value: Array) -> Array:
    """What a sensor shows, with all its errors beyond its class."""
    for term in terms:
        if isinstance(term, Reading) and term.place == place:
            value = term.shown(value)
    return value
