"""Pass 2a, check knowledge: documents to checked module types, faults, effects, sensors and
fluids, in SI."""

from collections.abc import Iterable, Iterator, Mapping

from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.check_dimensions import check_equations, provided_names
from rulec.knowledge.check_effect import EffectReader
from rulec.knowledge.check_fault import check_fault, frequency_at
from rulec.knowledge.check_fluid import FluidReader
from rulec.knowledge.check_module import ModuleReader
from rulec.knowledge.knowledge import FaultType, Knowledge, SensorClass, SensorError
from rulec.knowledge.sources import Sources, table_of
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.read_yaml import Document
from rulec.language.reader import Reader
from rulec.language.units import NONE


def check_knowledge(sources: Sources) -> Knowledge:
    """Check the meaning of all knowledge documents; raises `Refused` with all mistakes."""
    found: list[Diagnostic] = []
    units = table_of(sources.units, found)
    table = {
        kind: _refuse_duplicates(sources.by_kind.get(kind, ()), kind, found)
        for kind in ("module", "fault", "effect", "sensor", "fluid")
    }
    faults = {d.data["fault"]: check_fault(Reader(d, units, found)) for d in table["fault"]}
    sensors = {d.data["sensor"]: _sensor(Reader(d, units, found), faults) for d in table["sensor"]}
    effects = {d.data["effect"]: EffectReader(d, units, found).read() for d in table["effect"]}
    fluids = {d.data["fluid"]: FluidReader(d, units, found).read() for d in table["fluid"]}
    modules = {
        d.data["module"]: ModuleReader(d, units, found, sensors, faults).read()
        for d in table["module"]
    }
    elsewhere = provided_names(sources.by_kind.get("provider", ()), units, [])
    provided = {**elsewhere, **provided_names(table["module"], units, found)}
    for d in table["module"]:
        check_equations(Reader(d, units, found), modules[d.data["module"]], provided, faults)
    if found:
        raise Refused(found)
    return Knowledge(
        units=units, sensors=sensors, faults=faults, modules=modules, fluids=fluids, effects=effects
    )


def _refuse_duplicates(
    documents: Iterable[Document], kind: str, found: list[Diagnostic]
) -> tuple[Document, ...]:
    """The documents, without those whose name is taken; these are reported."""
    first: dict[str, Document] = {}
    for document in documents:
        name = document.data[kind]
        if name in first:
            message = f"the {kind} '{name}' is described in two files"
            second = first[name].place(kind)
            found.append(Diagnostic(document.place(kind), "KB030", message, "rename one", second))
        first.setdefault(name, document)
    return tuple(first.values())


def _sensor(reader: Reader, faults: Mapping[str, FaultType]) -> SensorClass:
    data = reader.document.data
    part = data["systematic"]
    unit = reader.unit("systematic", "unit")
    if part["of"] != "value" and not unit.dimension.fits(NONE):
        message = f"a bound of the {part['of']} is a share, but '{unit.text}' is {unit.dimension}"
        hint = "write '%', or let it be 'of: value'"
        reader.report(("systematic", "unit"), "KB053", message, hint)
    if data.get("measures"):
        reader.quantity("measures")
    return SensorClass(
        name=data["sensor"],
        title=data["title"],
        kind=part["of"],
        standard=part["bound"] * unit.factor / data["coverage"],
        unit=unit,
        cost=float(data.get("cost", 1.0)),
        measures=data.get("measures", ""),
        origin=reader.origin("systematic", source=data["source"]),
        errors=tuple(_errors(reader, faults)),
    )


def _errors(reader: Reader, faults: Mapping[str, FaultType]) -> Iterator[SensorError]:
    """The errors of a class: faults that act on a signal; none if no faults were read."""
    if not faults:
        return
    signal = [name for name, fault in faults.items() if fault.acts_on == "signal"]
    named: set[str] = set()
    for i, part in enumerate(reader.document.data.get("errors", ())):
        path, name = ("errors", i, "fault"), part["fault"]
        if name not in faults:
            reader.knows(path, signal, "KB047", "there is no fault '{}'", name)
        elif name not in signal:
            acts_on = faults[name].acts_on
            message = f"'{name}' acts on a {acts_on}; an error of a sensor acts on a signal"
            reader.report(path, "KB048", message, did_you_mean(name, signal))
        elif name in named:
            reader.report(path, "KB049", f"'{name}' stands twice", "keep one")
        else:
            named.add(name)
            frequency = frequency_at(reader, ("errors", i), part, "source")
            yield SensorError(name, reader.document.place(*path), frequency)
