"""Effects of a changed liquid: on a property that equations use, and on laws that do not use it."""

from dataclasses import dataclass

from rulec.knowledge.effect import PLAIN, EffectLaw, parse_law
from rulec.language.diagnostics import Origin
from rulec.language.expression import Rejected
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import PROPERTIES, Dimension

BY = "by"
"""In the law of a move: the reading that identifies the place."""

RATIO = "r"
"""In the law of a move: the property divided by its value at which the plain law holds."""


@dataclass(frozen=True, kw_only=True)
class Move:
    """How a law changes that gives a value of dimension `gives`, and falls or rises with a reading.

    `sign` is that of the slope by readings of `quantity`; `steep` is as in `Join`. `law` may use
    ``law`` (the plain law), ``law(by=...)`` (with that reading replaced) and ``r``.
    """

    gives: Dimension
    quantity: str
    sign: int
    steep: bool | None
    law: EffectLaw
    origin: Origin


@dataclass(frozen=True, kw_only=True)
class Liquid:
    """A property of the liquid that a fault changes.

    `per_kelvin` is its relative change with temperature, 1/K, known to a `factor`; 0 if it has
    none.
    """

    property: str
    moves: tuple[Move, ...]
    per_kelvin: float
    factor: float
    origin: Origin


def read_liquid(reader: Reader) -> Liquid | None:
    """The liquid of a fault that acts on one; the reader collects mistakes."""
    data = reader.document.data
    if data["acts_on"] != "liquid":
        return None
    name = data["property"]
    if name not in PROPERTIES:
        hint = " or ".join(PROPERTIES)
        reader.report(("property",), "KB054", f"a fluid has no property '{name}'", hint)
    moved = (_move(reader, ("moves", i)) for i in range(len(data.get("moves", ()))))
    by_temperature = data.get("per_kelvin", {"value": 0.0, "factor": 1.0})
    return Liquid(
        property=name,
        moves=tuple(move for move in moved if move is not None),
        per_kelvin=float(by_temperature["value"]),
        factor=float(by_temperature["factor"]),
        origin=reader.origin("per_kelvin" if "per_kelvin" in data else "property"),
    )


def _move(reader: Reader, path: Path_) -> Move | None:
    part = reader.part(path)
    key = "falls_with" if "falls_with" in part else "rises_with"
    gives = reader.quantity(*path, "gives")
    reader.quantity(*path, key)
    try:
        law = parse_law(part["law"])
    except Rejected as error:
        reader.report_error((*path, "law"), error)
        return None
    for name in sorted(law.names() - {BY, RATIO}):
        message = f"'{name}' is neither {PLAIN}, {PLAIN}({BY}=...) nor {RATIO}"
        reader.report((*path, "law"), "KB036", message)
    if gives is None:
        return None
    return Move(
        gives=gives,
        quantity=part[key],
        sign=-1 if key == "falls_with" else 1,
        steep=part.get("steep"),
        law=law,
        origin=reader.origin(*path, source=part["source"]),
    )
