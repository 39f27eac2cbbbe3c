"""Check the dimensions of all equations of a module type, as written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rulec.diagnostics import Diagnostic, did_you_mean
from rulec.document import Document
from rulec.expression import Expression, Rejected, dimension
from rulec.knowledge import ModuleType
from rulec.part_readers import within
from rulec.units import VOLUME_FLOW, Dimension


def provided_names(modules: Mapping[str, ModuleType]) -> dict[str, Dimension]:
    """Dimension of each name that some module type provides."""
    return {
        name: module.signals[signal].unit.dimension
        for module in modules.values()
        for name, signal in module.provides.items()
    }


def check_dimensions(
    document: Document,
    module: ModuleType,
    provided: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> None:
    """Check the dimensions of every equation as written."""
    if any(d.place.file == document.path for d in found):
        return
    known = {n: s.unit.dimension for n, s in module.signals.items()}
    known |= {n: p.unit.dimension for n, p in module.parameters.items()}
    gathered = dict(provided)
    for name in module.gathers:
        if name not in gathered:
            path = next(_gathering(document, module, name))
            hint = did_you_mean(name, provided)
            message = f"no module type provides '{name}'"
            found.append(Diagnostic(document.place(*path), "KB056", message, hint))
            return
    for definition in module.definitions.values():
        path = ("definitions", definition.name, "is")
        result = _dimension(document, path, definition.expression, known, gathered, found)
        if result is None:
            return
        known[definition.name] = result
    for observer in module.observers.values():
        path = ("observers", observer.name, "Q")
        result = _dimension(document, path, observer.expression, known, gathered, found)
        if result is not None and result != VOLUME_FLOW:
            message = f"an observer gives a volume flow ({VOLUME_FLOW}), but this is {result}"
            found.append(Diagnostic(document.place(*path), "KB057", message, "check each factor"))


def _gathering(document: Document, module: ModuleType, name: str) -> Iterator[tuple[str, str, str]]:
    for definition in module.definitions.values():
        if name in (n for n, _ in definition.expression.gathered()):
            yield "definitions", definition.name, "is"
    for observer in module.observers.values():
        if name in (n for n, _ in observer.expression.gathered()):
            yield "observers", observer.name, "Q"


def _dimension(
    document: Document,
    path: tuple[str | int, ...],
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> Dimension | None:
    try:
        return dimension(expression, known, gathered)
    except Rejected as error:
        place = within(document.place(*path), error.column, error.length, expression.text)
        found.append(Diagnostic(place, error.code, error.message, error.hint))
        return None
