"""Pass 2a, check knowledge: documents to checked module types, faults, effects, sensors and
fluids, in SI."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.knowledge.check_dimensions import check_comparisons, check_dimensions, provided_names
from rulec.knowledge.check_effect import check_effect
from rulec.knowledge.check_fault import check_fault
from rulec.knowledge.check_fluid import check_fluid
from rulec.knowledge.check_module import check_module
from rulec.knowledge.knowledge import Knowledge, SensorClass
from rulec.knowledge.read import Sources
from rulec.language.diagnostics import Diagnostic, Refused, did_you_mean
from rulec.language.document import Document
from rulec.language.part_readers import origin_of, read_unit
from rulec.language.units import NONE, UnitTable, unit_table


def check_knowledge(sources: Sources) -> Knowledge:
    """Check the meaning of all knowledge documents; raises `Refused` with every mistake."""
    found: list[Diagnostic] = []
    units = unit_table(sources.units.data)
    table = {
        kind: _refuse_twins(sources.by_kind.get(kind, ()), kind, found)
        for kind in ("module", "fault", "effect", "sensor", "fluid")
    }
    sensors = {d.data["sensor"]: _sensor(d, units, found) for d in table["sensor"]}
    faults = {d.data["fault"]: check_fault(d, found) for d in table["fault"]}
    effects = {d.data["effect"]: check_effect(d, units, found) for d in table["effect"]}
    fluids = {d.data["fluid"]: check_fluid(d, units, found) for d in table["fluid"]}
    modules = {
        d.data["module"]: check_module(d, units, sensors, faults, found) for d in table["module"]
    }
    elsewhere = provided_names(sources.by_kind.get("provider", ()), units, [])
    provided = {**elsewhere, **provided_names(table["module"], units, found)}
    for document in table["module"]:
        check_dimensions(document, modules[document.data["module"]], provided, found)
        check_comparisons(document, modules[document.data["module"]], found)
    if found:
        raise Refused(found)
    return Knowledge(
        units=units, sensors=sensors, faults=faults, modules=modules, fluids=fluids, effects=effects
    )


def _refuse_twins(
    documents: Iterable[Document], kind: str, found: list[Diagnostic]
) -> tuple[Document, ...]:
    """The documents without those whose name is taken, which are reported."""
    first: dict[str, Document] = {}
    for document in documents:
        name = document.data[kind]
        if name in first:
            message = f"the {kind} '{name}' is described in two files"
            second = first[name].place(kind)
            found.append(Diagnostic(document.place(kind), "KB030", message, "rename one", second))
        first.setdefault(name, document)
    return tuple(first.values())


def _sensor(document: Document, units: UnitTable, found: list[Diagnostic]) -> SensorClass:
    data, part = document.data, document.data["systematic"]
    unit = read_unit(document, ("systematic", "unit"), units, found)
    relative = part["of"] != "value"
    if relative and not unit.dimension.fits(NONE):
        message = f"a bound of the {part['of']} is a share, but '{unit.text}' is {unit.dimension}"
        hint = "write '%', or let it be 'of: value'"
        found.append(Diagnostic(document.place("systematic", "unit"), "KB053", message, hint))
    if data.get("measures", "") not in {"", *units.quantities}:
        message = f"there is no quantity '{data['measures']}'"
        hint = did_you_mean(data["measures"], units.quantities)
        found.append(Diagnostic(document.place("measures"), "KB054", message, hint))
    return SensorClass(
        name=data["sensor"],
        title=data["title"],
        kind=part["of"],
        standard=part["bound"] * unit.factor / data["coverage"],
        unit=unit,
        cost=float(data.get("cost", 1.0)),
        measures=data.get("measures", ""),
        origin=origin_of(document, "systematic", source=data["source"]),
    )
