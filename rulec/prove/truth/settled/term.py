"""Terms beyond the plain laws of a plant, added where they act."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..units import Array

Kind = Literal["slip", "gain", "head", "loss", "power", "shaft", "leak", "friction"]
"""Where a term acts: `slip` lost flow of the pump, m3/s; `gain` lost share of the delivered flow;
`head` lost pressure of a centrifugal pump, Pa; `loss` of a line or mixer, Pa; `power` at the motor,
W; `shaft` lost share of the shown speed; `leak` share of the pump's flow that returns; `friction`
added share of the friction of a line or mixer."""


@dataclass(frozen=True)
class State:
    """Operating point of one module or mixer; arrays of shape (n,).

    Attributes
    ----------
    speed : of the shaft, rev/s
    flow : net flow, m3/s
    pressure : across the pump, or behind a line, Pa
    power, idle : of the plain law, W, at the pressure and at none
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
    """The reading of a sensor by its true value, both SI, shape (n,); `place` such as `A.dp`."""

    place: str
    shown: Callable[[Array], Array]


@dataclass(frozen=True)
class Column:
    """The column of `place` in the file by the correct columns, each of shape (n,).

    The columns include noise. Units play no part.
    """

    place: str
    written: Callable[[Mapping[str, Array]], Array]


Change = Term | Reading | Column


def total(terms: Iterable[Change], kind: Kind, module: str, state: State) -> Array | float:
    """Return the sum of all terms of a kind in a module."""
    found = [
        t.law(state) for t in terms if isinstance(t, Term) and t.kind == kind and t.module == module
    ]
    return np.sum(found, axis=0) if found else 0.0


def written_by(terms: Sequence[Change], columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns in the file by place."""
    wrong = {t.place: t.written(columns) for t in terms if isinstance(t, Column)}
    return {**columns, **wrong}


def shown_by(terms: Sequence[Change], place: str, value: Array) -> Array:
    """Return the reading of a sensor with all its errors beyond its class."""
    for term in terms:
        if isinstance(term, Reading) and term.place == place:
            value = term.shown(value)
    return value
