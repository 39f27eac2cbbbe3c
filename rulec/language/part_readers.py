"""Read single parts of a document: places of origin, units, equations."""

from __future__ import annotations

from rulec.language.diagnostics import Diagnostic, Place, nearest
from rulec.language.document import Document
from rulec.language.expression import Expression, Rejected, parse
from rulec.language.origin import Origin
from rulec.language.units import UNKNOWN, Unit, UnitTable


def origin_of(document: Document, *path: str | int, source: str = "") -> Origin:
    """Origin of a part of a document."""
    place = document.key(*path) if path else document.place()
    return Origin(document.label, place.line, source)


def read_unit(
    document: Document, path: tuple[str | int, ...], units: UnitTable, found: list[Diagnostic]
) -> Unit:
    """Read the unit at a path; an unknown one is reported, and then fits everything."""
    part = document.data
    for step in path:
        part = part[step]
    try:
        return units.parse(part)
    except ValueError as error:
        name = str(error)
        near = nearest(name, units.units)
        hint = f"did you mean '{near}'?" if near else "the spellings are in kb/units.yaml"
        if "^" in name:
            hint = "write a power as in 'l/h/bar**2'"
        message = f"there is no unit '{name[:40]}'"
        place = document.place(*path)
        if name != part:
            place = within(place, part.find(name), len(name), part)
        found.append(Diagnostic(place, "KB050", message, hint))
        return Unit(part, 1.0, UNKNOWN)


def read_expression(
    document: Document, path: tuple[str | int, ...], found: list[Diagnostic]
) -> Expression:
    """Read the equation at a path; a refused one is reported and counts as 0."""
    part = document.data
    for step in path:
        part = part[step]
    try:
        return parse(str(part))
    except Rejected as error:
        place = within(document.place(*path), error.column, error.length, str(part))
        found.append(Diagnostic(place, error.code, error.message, error.hint))
        return parse("0")


def within(place: Place, column: int, length: int, text: str) -> Place:
    """Place of a part of a scalar; of all of it where it has several lines or escapes."""
    quote = place.length - len(text)
    if quote not in (0, 2):
        return place
    return Place(place.file, place.line, place.column + quote // 2 + column, length)
