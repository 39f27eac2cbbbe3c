"""Pass 2b, check plant: check the plant's documents against the knowledge, convert to SI."""

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zoneinfo import available_timezones

import numpy as np
from rulec_runtime.contract.file_form import INFERRED
from rulec_runtime.contract.ruleset import ColumnMap
from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.check_module import check_value, with_sensor
from rulec.knowledge.file_form import file_form, time_title
from rulec.knowledge.fluid import fill
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.limits import ASYMMETRY, CORRELATION_RIDGE
from rulec.knowledge.module_type import ModuleType, Parameter
from rulec.knowledge.plant import Block, Module, Plant
from rulec.knowledge.sources import Sources
from rulec.language.diagnostics import Diagnostic, Place, Refused
from rulec.language.read_yaml import Document, Path_
from rulec.language.reader import Reader
from rulec.language.units import VOLUME_FLOW, Unit
from rulec.language.write_yaml import rounded


def check(sources: Sources) -> Plant:
    """Check knowledge and plant; raises `Refused` with all mistakes of meaning."""
    return check_plant(sources, check_knowledge(sources))


def check_plant(sources: Sources, knowledge: Knowledge) -> Plant:
    """Check a plant against checked knowledge; raises `Refused` with all mistakes."""
    document = sources.plant
    assert document is not None
    names = sources.names("module"), sources.names("fluid")
    reader = _PlantReader(document, knowledge.units, [], knowledge, *names)
    modules = reader.modules()
    for calibration in sources.calibrations:
        modules = reader.calibrate(modules, calibration)
    modules = reader.fill(modules)
    connections = reader.connections(sources.adjacency)
    columns, time_column = reader.columns(modules, sources.columns)
    time_zone = reader.time_zone(sources.columns)
    file = INFERRED if sources.columns is None else file_form(reader.reader_of(sources.columns))
    if reader.found:
        raise Refused(reader.found)
    return Plant(
        name=document.data["plant"],
        title=document.data["title"],
        modules=modules,
        connections=connections,
        columns=columns,
        time_column=time_column,
        time_zone=time_zone,
        file=file,
        knowledge=knowledge,
        digest=sources.digest(),
        place=document.place("plant"),
        layers=sources.made_from(),
    )


@dataclass
class _PlantReader(Reader):
    """Reads a plant document and, with other readers, the files that belong to it.

    `types` and `fluids` are the names in the knowledge base.
    """

    knowledge: Knowledge
    types: set[str]
    fluids: set[str]

    @property
    def _names(self) -> Mapping[str, Any]:
        """Modules by name, including those of an unknown type, which are reported once."""
        names: Mapping[str, Any] = self.document.data["modules"]
        return names

    def reader_of(self, document: Document) -> Reader:
        return Reader(document, self.units, self.found)

    def _report_at(self, place: Place, code: str, message: str, hint: str = "") -> None:
        """Report a mistake in a file that is not YAML."""
        self.found.append(Diagnostic(place, code, message, hint))

    def modules(self) -> dict[str, Module]:
        """Modules of known types by name, with the values that the plant states."""
        result = {}
        for name, part in self.document.data["modules"].items():
            path, kind = ("modules", name), self.knowledge.modules.get(part["type"])
            if kind is None:
                message = "there is no module type '{}'"
                others = self.types - {part["type"]}
                self.knows((*path, "type"), others, "KB070", message, part["type"])
                continue
            kind = self._with_sensors(path, part, kind)
            parameters = {**kind.parameters, **_values(self, path, part, kind)}
            typical = {
                s.name: s.reference for s in kind.signals.values() if s.reference is not None
            }
            for key, value in part.get("reference", {}).items():
                if _has_signal(self, (*path, "reference", key), kind):
                    typical[key] = kind.signals[key].unit.to_si(value)
            result[name] = Module(
                name=name,
                title=part.get("title", kind.title),
                type=kind,
                stated=parameters,
                parameters=parameters,
                blocks=(),
                misfit={},
                valid={},
                reference=typical,
            )
        return result

    def _with_sensors(self, path: Path_, part: Mapping[str, Any], kind: ModuleType) -> ModuleType:
        """The type with the sensors that the plant states for an instance."""
        if "signals" not in part:
            return kind
        signals = dict(kind.signals)
        for key, own in part["signals"].items():
            where = (*path, "signals", key)
            if _has_signal(self, where, kind):
                signal = signals[key]
                unit = self.unit(*where, "unit") if "unit" in own else signal.unit
                _check_unit(self, where, unit, signal.unit, "KB073")
                signals[key] = with_sensor(self, where, signal, unit, self.knowledge.sensors)
        return replace(kind, signals=signals, instruments=json.dumps(part["signals"]))

    def calibrate(self, modules: dict[str, Module], document: Document) -> dict[str, Module]:
        result, reader = dict(modules), self.reader_of(document)
        for name, part in document.data["modules"].items():
            path = ("modules", name)
            reader.knows(path, self._names, "KB074", "this plant has no module '{}'")
            if name not in modules:
                continue
            kind = modules[name].type
            if part["type"] != kind.name:
                message = f"calibrated as '{part['type']}', but the plant has a '{kind.name}'"
                second = self.document.place("modules", name, "type")
                reader.report((*path, "type"), "KB075", message, "calibrate again", second)
                continue
            result[name] = _calibrated(reader, path, part, result[name])
        return result

    def fill(self, modules: dict[str, Module]) -> dict[str, Module]:
        """Modules with their own fluid or the plant's, which is put into equations that use it."""
        data, fluids = self.document.data, self.knowledge.fluids
        named = [(("modules", n, "fluid"), m.get("fluid")) for n, m in data["modules"].items()]
        for path, fluid in (*named, (("fluid",), data.get("fluid"))):
            if fluid is not None and fluid not in fluids:
                self.knows(path, self.fluids - {fluid}, "KB065", "there is no fluid '{}'", fluid)
        result = dict(modules)
        for name, module in modules.items():
            fluid = data["modules"][name].get("fluid", data.get("fluid"))
            if fluid in fluids:
                there = replace(module, fluid=fluids[fluid])
                result[name] = fill(there, fluids[fluid]) if module.type.asks else there
            elif fluid is None and module.type.asks:
                used = " and ".join(module.type.asks)
                message = f"'{module.type.name}' asks for {used}, but no fluid is named"
                hint = "add 'fluid: ...' to the plant; " + did_you_mean("", self.fluids)
                self.report(("modules", name, "type"), "KB066", message, hint)
        return result

    def connections(self, adjacency: tuple[str, str] | None) -> tuple[tuple[str, str], ...]:
        """Pairs (source, target), from the list or an adjacency table (file name, text)."""
        if adjacency is not None:
            if "connections" in self.document.data:
                second = self.document.key("connections")
                message = "connections are given twice: here and as a list"
                self.report_key(("adjacency",), "KB084", message, "keep one", second)
            return self._adjacency(*adjacency)
        result: list[tuple[str, str]] = []
        for i, text in enumerate(self.document.data.get("connections", ())):
            path = ("connections", i)
            source, target = text.split(" -> ")
            for name, column in ((source, 0), (target, len(source) + 4)):
                message = "this plant has no module '{}'"
                self.knows(path, self._names, "KB080", message, name, column)
            if source == target:
                message = f"'{source}' cannot feed itself directly"
                self.report(path, "KB081", message, "a return needs a module in between")
            elif (source, target) in result:
                second = self.document.place("connections", result.index((source, target)))
                self.report(path, "KB082", f"'{text}' stands twice", "keep one", second)
            result.append((source, target))
        return tuple(result)

    def _adjacency(self, name: str, text: str) -> tuple[tuple[str, str], ...]:
        """Row feeds column where the entry is 1."""
        file = (Path(self.document.path).parent / name).as_posix()
        reader = csv.reader(io.StringIO(text))
        try:
            rows = [(reader.line_num, [c.strip() for c in row]) for row in reader]
        except csv.Error as error:
            self._report_at(Place(file, reader.line_num), "KB083", f"not a table: {error}")
            return ()
        table = [(line, row) for line, row in rows if any(row)]
        if ";" in text and "," not in text:
            hint = "separate the cells by commas, not by semicolons"
            self._report_at(Place(file), "KB083", "this table has one column", hint)
            return ()
        first, names = (table[0][0], table[0][1][1:]) if table else (1, [])
        if self._names.keys().isdisjoint(names):
            message = f"the first row of '{name}' names no module of this plant"
            self.report(("adjacency",), "KB083", message, "a column, and below it a row, for each")
            return ()
        result: list[tuple[str, str]] = []
        self._compare(Place(file, first), names, "column")
        self._compare(Place(file, first), [row[0] for _, row in table[1:]], "row")
        for line, (source, *entries) in table[1:]:
            if len(entries) != len(names) or any(e not in ("", "0", "1") for e in entries):
                message = f"the row of '{source[:40]}' is not {len(names)} times 0 or 1"
                self._report_at(Place(file, line), "KB083", message)
                continue
            fed = [n for n, e in zip(names, entries, strict=True) if e == "1"]
            if source in fed:
                message = f"'{source}' cannot feed itself directly"
                self._report_at(Place(file, line), "KB081", message, "write 0 on the diagonal")
            result += [(source, n) for n in fed]
        return tuple(result)

    def _compare(self, place: Place, names: list[str], side: str) -> None:
        """Check that each module, and nothing else, has one row and one column."""
        for name in sorted({*names, *self._names}):
            if name not in self._names:
                message = f"the {side} '{name[:40]}' is not a module of this plant"
                self._report_at(place, "KB083", message, did_you_mean(name, self._names))
            elif names.count(name) != 1:
                count = f"{names.count(name)} {side}s" if name in names else f"no {side}"
                message = f"the module '{name}' has {count}"
                self._report_at(place, "KB083", message)

    def columns(
        self, modules: Mapping[str, Module], document: Document | None
    ) -> tuple[tuple[ColumnMap, ...], str]:
        """Columns of a recording, and the name of the time column."""
        if document is None:
            return (), ""
        result, time_column, reader = [], "", self.reader_of(document)
        for key, part in document.data["columns"].items():
            path = ("columns", key)
            if key == "time":
                time_column = time_title(part)
                continue
            unit = reader.unit(*path, "unit")
            module, signal = key.split(".")
            if module in self._names and module not in modules:
                continue
            signals = modules[module].type.signals if module in modules else {}
            if signal not in signals:
                known = [f"{m.name}.{s}" for m in modules.values() for s in m.type.signals]
                reader.knows(path, known, "KB085", "this plant has no signal '{}'")
                continue
            _check_unit(reader, path, unit, signals[signal].unit, "KB086")
            result.append(_column(key, part, unit, 1.0))
            if "minus" in part:
                where = (*path, "minus")
                other = reader.unit(*where, "unit") if "unit" in part["minus"] else unit
                _check_unit(reader, where, other, unit, "KB086")
                result.append(_column(key, part["minus"], other, -1.0))
                sensor = self.knowledge.sensors[signals[signal].sensor]
                if sensor.kind == "reading":
                    message = f"the class '{sensor.name}' is a share of what one sensor shows"
                    hint = "state another in plant.yaml, under 'signals' of the module"
                    reader.report_key(where, "KB128", message, hint)
        return tuple(result), time_column

    def time_zone(self, document: Document | None) -> str:
        """Time zone of dates that state none; an unknown zone is reported."""
        time = {} if document is None else document.data["columns"].get("time", {})
        zone = str(time.get("zone", ""))
        known = available_timezones() if zone else ()
        if document is not None and known and zone not in known:
            reader, path = self.reader_of(document), ("columns", "time", "zone")
            hint = did_you_mean(zone, known)
            reader.report(path, "KB124", f"there is no time zone '{zone[:40]}'", hint)
        return zone


def _column(signal: str, part: Mapping[str, Any], unit: Unit, sign: float) -> ColumnMap:
    """A column in a unit that is a reading (`sign` 1), or is subtracted from one (-1)."""
    factor = float(part.get("scale", 1)) * unit.factor
    offset = float(part.get("offset", 0)) * unit.factor + unit.offset
    return ColumnMap(signal, part["from"], sign * factor, sign * offset)


def _values(
    reader: Reader, path: Path_, part: Mapping[str, Any], kind: ModuleType, source: str = ""
) -> dict[str, Parameter]:
    """Changed parameters of a module; unknown names and unfitting units are reported."""
    result = {}
    for key, value in part.get("parameters", {}).items():
        where, stated = (*path, "parameters", key), kind.parameters.get(key)
        if stated is None:
            reader.knows(where, kind.parameters, "KB072", f"'{kind.name}' has no parameter '{{}}'")
            continue
        unit = reader.unit(*where, "unit")
        declared = f"{stated.title}; declared in {stated.origin.file}:{stated.origin.line}"
        _check_unit(reader, where, unit, stated.unit, "KB073", declared)
        result[key] = replace(
            stated,
            value=unit.to_si(value["value"]),
            u=value.get("u", 0.0) * unit.factor,
            unit=unit,
            origin=reader.origin(*where, source=source or value["source"]),
        )
        check_value(reader, where, result[key])
    return result


def _has_signal(reader: Reader, path: Path_, kind: ModuleType) -> bool:
    """Whether the key at a path is a signal of a type; otherwise it is reported."""
    return reader.knows(path, kind.signals, "KB071", f"'{kind.name}' has no signal '{{}}'")


def _calibrated(reader: Reader, path: Path_, part: Mapping[str, Any], module: Module) -> Module:
    kind, source = module.type, f"calibration {reader.document.label}"
    parameters = {**module.parameters, **_values(reader, path, part, kind, source)}
    blocks = [
        _block(reader, (*path, "covariance", i), block, parameters)
        for i, block in enumerate(part.get("covariance", ()))
    ]
    misfit = {}
    for key, value in part.get("misfit", {}).items():
        where = (*path, "misfit", key)
        unit = reader.unit(*where, "unit")
        misfit[key] = value["value"] * unit.factor
        if not unit.dimension.fits(VOLUME_FLOW):
            message = f"a misfit is a volume flow; '{unit.text}' does not fit"
            reader.report((*where, "unit"), "KB073", message)
        reader.knows(where, kind.observers, "KB076", "there is no observer '{}'")
    valid = {}
    for key, value in part.get("range", {}).items():
        where = (*path, "range", key)
        unit = reader.unit(*where, "unit")
        valid[key] = (unit.to_si(value["from"]), unit.to_si(value["to"]))
        if value["from"] != value["to"]:
            reader.check_range(value["from"], value["to"], *where, "to")
        if _has_signal(reader, where, kind):
            _check_unit(reader, where, unit, kind.signals[key].unit, "KB073")
    kept = tuple(b for b in blocks if b is not None)
    return replace(module, parameters=parameters, blocks=kept, misfit=misfit, valid=valid)


def _block(
    reader: Reader, path: Path_, block: Mapping[str, Any], parameters: Mapping[str, Parameter]
) -> Block | None:
    """Read and factor a covariance block, which must be symmetric and positive definite."""
    names, where = tuple(block["of"]), (*path, "matrix")
    for i, name in enumerate(names):
        message = "there is no parameter '{}'"
        if not reader.knows((*path, "of", i), parameters, "KB072", message, name):
            return None
        if name in names[:i]:
            reader.report((*path, "of", i), "KB049", f"'{name}' stands twice", "keep one")
            return None
    rows = block["matrix"]
    if len(rows) != len(names) or any(len(row) != len(names) for row in rows):
        size = f"{len(names)} row{'s' * (len(names) > 1)} of {len(names)}"
        reader.report(where, "KB077", f"this covariance is not {size}", "one for each of 'of'")
        return None
    scale = np.array([parameters[n].unit.factor for n in names])
    matrix = np.array(rows, dtype=float)
    spread = np.sqrt(np.abs(np.diag(matrix)))
    spread[spread == 0] = 1.0
    normal = matrix / np.outer(spread, spread)
    if not np.all(np.isfinite(normal)) or np.max(np.abs(normal - normal.T)) > ASYMMETRY:
        hint = "row i, entry j is row j, entry i"
        reader.report(where, "KB078", "this covariance is not symmetric", hint)
        return None
    try:
        factor = np.linalg.cholesky(normal + CORRELATION_RIDGE * np.eye(len(names)))
    except np.linalg.LinAlgError:
        hint = "is a variance below 0, or a correlation beyond 1?"
        reader.report(where, "KB079", "this covariance is not positive", hint)
        return None
    factor = factor * (spread * scale)[:, None]
    return Block(names, tuple(tuple(rounded(float(v), 12) for v in row) for row in factor))


def _check_unit(
    reader: Reader, path: Path_, unit: Unit, wanted: Unit, code: str, hint: str = ""
) -> None:
    """Report a unit under a path that does not fit the declared one."""
    if not unit.dimension.fits(wanted.dimension):
        message = f"'{path[-1]}' is in {wanted.text}; '{unit.text}' does not fit"
        reader.report((*path, "unit"), code, message, hint)
