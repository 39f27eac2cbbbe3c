"""Check the dimensions and comparisons of all equations of a module type, as written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import sympy

from rulec.knowledge.module_type import ENDS, Definition, ModuleType, Observer
from rulec.language.diagnostics import Diagnostic, Place, did_you_mean
from rulec.language.dimension import dimension
from rulec.language.document import Document
from rulec.language.expression import Expression, Rejected, constant
from rulec.language.part_readers import read_unit, within
from rulec.language.symbolic import to_sympy
from rulec.language.units import PROPERTIES, SECOND, UNKNOWN, VOLUME_FLOW, Dimension, UnitTable


def provided_names(
    documents: Iterable[Document], units: UnitTable, found: list[Diagnostic]
) -> dict[str, Dimension]:
    """Dimension of each name that some module type provides; they must agree on it."""
    result: dict[str, Dimension] = {}
    first: dict[str, Place] = {}
    for document in documents:
        for name, signal in document.data.get("provides", {}).items():
            if signal not in document.data.get("signals", {}):
                continue
            place = document.key("provides", name)
            own = read_unit(document, ("signals", signal, "unit"), units, []).dimension
            if not own.fits(result.get(name, own)):
                message = f"'{name}' is {own} here, but {result[name]} in another module"
                hint = "what is summed must be of one kind"
                found.append(Diagnostic(place, "KB058", message, hint, first[name]))
            result.setdefault(name, own)
            first.setdefault(name, place)
    return result


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
    known |= {n: s.unit.dimension for n, s in module.states.items()} | dict.fromkeys(
        ENDS, VOLUME_FLOW
    )
    gathered = {name: provided.get(name, UNKNOWN) for name in module.gathers}
    for definition in module.definitions.values():
        path = ("definitions", definition.name, "is")
        _check_gathered(document, path, definition.expression, provided, found)
        known[definition.name] = _dimension(
            document, path, definition.expression, known, gathered, found
        )
        if definition.name in ENDS and not known[definition.name].fits(VOLUME_FLOW):
            message = f"'{definition.name}' is a volume flow, but this is {known[definition.name]}"
            found.append(Diagnostic(document.place(*path), "KB057", message, "check each factor"))
    for observer in module.observers.values():
        path = ("observers", observer.name, "Q")
        _check_gathered(document, path, observer.expression, provided, found)
        result = _dimension(document, path, observer.expression, known, gathered, found)
        if not result.fits(VOLUME_FLOW):
            message = f"an observer gives a volume flow ({VOLUME_FLOW}), but this is {result}"
            found.append(Diagnostic(document.place(*path), "KB057", message, "check each factor"))
    for state in module.states.values():
        for key, expression in state.equations():
            path = ("states", state.name, key)
            wanted = {"der": state.unit.dimension / SECOND, "after": SECOND}.get(
                key, state.unit.dimension
            )
            _check_gathered(document, path, expression, provided, found)
            _check_given(document, path, expression, wanted, known, gathered, found)
    for reading in module.readings.values():
        path, wanted = ("readings", reading.name, "is"), known[reading.name]
        _check_gathered(document, path, reading.expression, provided, found)
        _check_given(document, path, reading.expression, wanted, known, gathered, found)


def _check_given(
    document: Document,
    path: tuple[str | int, ...],
    expression: Expression,
    wanted: Dimension,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> None:
    """The equation of a state or a reading gives what it is to give; a bare number always does."""
    result = _dimension(document, path, expression, known, gathered, found)
    if not result.fits(wanted) and constant(expression, {}) is None:
        message = f"this is {result}, but should be {wanted}"
        found.append(Diagnostic(document.place(*path), "KB112", message, "check each factor"))


def check_comparisons(document: Document, module: ModuleType, found: list[Diagnostic]) -> None:
    """Refuse min and max of something that is no real number, as sympy would not compare it."""
    parts: list[tuple[tuple[str, str, str], Definition | Observer]] = []
    parts += [(("definitions", d.name, "is"), d) for d in module.definitions.values()]
    parts += [(("observers", o.name, "Q"), o) for o in module.observers.values()]
    compares = any(word in part.expression.text for _, part in parts for word in ("min", "max"))
    if not compares or any(d.place.file == document.path for d in found):
        return
    names = (*module.signals, *module.parameters, *module.states, *ENDS)
    table: dict[str, sympy.Expr] = {n: sympy.Symbol(n, real=True) for n in names}
    gathered = {n: sympy.Symbol(f"downstream.{n}", real=True) for n in module.gathers}
    asked = {n: lambda _, n=n: sympy.Symbol(n, positive=True) for n in PROPERTIES}
    for path, part in parts:
        try:
            table[part.name] = to_sympy(part.expression, table, gathered, asked)
        except ValueError:
            message = "min() or max() gets something that is no real number"
            hint = "is there a root of something below 0, or a division by 0?"
            found.append(Diagnostic(document.place(*path), "KB041", message, hint))
            return


def _check_gathered(
    document: Document,
    path: tuple[str | int, ...],
    expression: Expression,
    provided: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> None:
    for name, column in expression.gathered():
        if name not in provided:
            place = within(document.place(*path), column, len(name), expression.text)
            message = f"no module type provides '{name}'"
            found.append(Diagnostic(place, "KB056", message, did_you_mean(name, provided)))


def _dimension(
    document: Document,
    path: tuple[str | int, ...],
    expression: Expression,
    known: Mapping[str, Dimension],
    gathered: Mapping[str, Dimension],
    found: list[Diagnostic],
) -> Dimension:
    """Dimension of an equation; a misfit is reported, and what it gives then fits everything."""
    try:
        return dimension(expression, known, gathered)
    except Rejected as error:
        place = within(document.place(*path), error.column, error.length, expression.text)
        found.append(Diagnostic(place, error.code, error.message, error.hint))
        return UNKNOWN
