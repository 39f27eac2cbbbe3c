"""Pass 2b, check plant: the plant's documents against the knowledge, all values in SI."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.fluid import fill
from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import ModuleType, Parameter
from rulec.knowledge.plant import Block, Column, Module, Plant
from rulec.knowledge.read import Sources
from rulec.language.diagnostics import Diagnostic, Place, Refused, did_you_mean
from rulec.language.document import Document, Path_
from rulec.language.part_readers import origin_of, read_unit, within
from rulec.language.units import VOLUME_FLOW, Dimension, Unit


def check(sources: Sources) -> Plant:
    """Check knowledge and plant; raises `Refused` with every mistake of meaning."""
    return check_plant(sources, check_knowledge(sources))


def check_plant(sources: Sources, knowledge: Knowledge) -> Plant:
    """Check a plant against checked knowledge."""
    document = sources.plant
    assert document is not None
    reader = _PlantReader(document, knowledge, sources.names("module"), sources.names("fluid"))
    modules = reader.modules()
    for calibration in sources.calibrations:
        modules = reader.calibrate(modules, calibration)
    modules = reader.fill(modules)
    connections = reader.connections(sources.adjacency)
    columns, time_column = reader.columns(modules, sources.columns)
    if reader.found:
        raise Refused(reader.found)
    return Plant(
        name=document.data["plant"],
        title=document.data["title"],
        modules=modules,
        connections=connections,
        columns=columns,
        time_column=time_column,
        knowledge=knowledge,
        digest=sources.digest(),
        place=document.place("plant"),
    )


_SECOND = Dimension.of({"s": 1})

LEAST_SCALE = 1e-12
"""No reading: the reciprocal of the largest scale that columns.schema.json lets pass."""


@dataclass
class _PlantReader:
    """Reads a plant document and what belongs to it; mistakes go to `found`."""

    document: Document
    knowledge: Knowledge
    types: set[str]
    fluids: set[str]
    found: list[Diagnostic] = field(default_factory=list)

    @property
    def _names(self) -> Mapping[str, Any]:
        """Modules by name, also those of an unknown type, which are reported once."""
        names: Mapping[str, Any] = self.document.data["modules"]
        return names

    def _hint(self, name: str) -> str:
        return did_you_mean(name, self._names)

    def _report(
        self, place: Place, code: str, message: str, hint: str = "", second: Place | None = None
    ) -> None:
        self.found.append(Diagnostic(place, code, message, hint, second))

    def modules(self) -> dict[str, Module]:
        result = {}
        for name, part in self.document.data["modules"].items():
            kind = self.knowledge.modules.get(part["type"])
            if kind is None:
                place = self.document.place("modules", name, "type")
                hint = did_you_mean(part["type"], self.types)
                self._report(place, "KB070", f"there is no module type '{part['type']}'", hint)
                continue
            result[name] = self._module(name, part, kind)
        return result

    def _module(self, name: str, part: Mapping[str, Any], kind: ModuleType) -> Module:
        path = ("modules", name, "parameters")
        parameters = dict(kind.parameters)
        for key, value in part.get("parameters", {}).items():
            changed = self._value(self.document, (*path, key), value, kind, key, value["source"])
            if changed is not None:
                parameters[key] = changed
        reference = {}
        for key, value in part.get("reference", {}).items():
            signal = kind.signals.get(key)
            if signal is None:
                place = self.document.key("modules", name, "reference", key)
                hint = did_you_mean(key, kind.signals)
                self._report(place, "KB071", f"'{kind.name}' has no signal '{key}'", hint)
                continue
            reference[key] = signal.unit.to_si(value)
        for signal in kind.signals.values():
            if signal.reference is not None:
                reference.setdefault(signal.name, signal.reference)
        title = part.get("title", kind.title)
        return Module(
            name=name,
            title=title,
            type=kind,
            stated=parameters,
            parameters=parameters,
            blocks=(),
            misfit={},
            valid={},
            reference=reference,
        )

    def _value(
        self,
        document: Document,
        path: tuple[str | int, ...],
        value: Mapping[str, Any],
        kind: ModuleType,
        key: str,
        source: str,
    ) -> Parameter | None:
        """A changed parameter value; reports unknown names and units that do not fit."""
        known = kind.parameters.get(key)
        if known is None:
            hint = did_you_mean(key, kind.parameters)
            self._report(
                document.key(*path), "KB072", f"'{kind.name}' has no parameter '{key}'", hint
            )
            return None
        unit = read_unit(document, (*path, "unit"), self.knowledge.units, self.found)
        if not unit.dimension.fits(known.unit.dimension):
            message = f"'{key}' is in {known.unit.text}; '{unit.text}' does not fit"
            hint = f"declared in {known.origin.file}:{known.origin.line}"
            self._report(document.place(*path, "unit"), "KB073", message, hint)
        u = value.get("u", 0.0) * unit.factor
        origin = origin_of(document, *path, source=source)
        return replace(known, value=unit.to_si(value["value"]), u=u, unit=unit, origin=origin)

    def calibrate(self, modules: dict[str, Module], document: Document) -> dict[str, Module]:
        """Take over the values of a calibration file."""
        result = dict(modules)
        for name, part in document.data["modules"].items():
            path = ("modules", name)
            if name not in self._names:
                message = f"this plant has no module '{name}'"
                self._report(document.key(*path), "KB074", message, self._hint(name))
            if name not in modules:
                continue
            kind = modules[name].type
            if part["type"] != kind.name:
                message = f"calibrated as '{part['type']}', but the plant has a '{kind.name}'"
                place = document.place(*path, "type")
                second = self.document.place("modules", name, "type")
                self._report(place, "KB075", message, "calibrate again", second)
                continue
            result[name] = self._calibrated(document, path, part, result[name])
        return result

    def _calibrated(
        self,
        document: Document,
        path: tuple[str | int, ...],
        part: Mapping[str, Any],
        module: Module,
    ) -> Module:
        parameters = dict(module.parameters)
        source = f"calibration {document.label}"
        for key, value in part.get("parameters", {}).items():
            where = (*path, "parameters", key)
            changed = self._value(document, where, value, module.type, key, source)
            if changed is not None:
                parameters[key] = changed
        blocks = [
            self._block(document, (*path, "covariance", i), block, parameters)
            for i, block in enumerate(part.get("covariance", ()))
        ]
        misfit = {}
        for key, value in part.get("misfit", {}).items():
            unit = read_unit(
                document, (*path, "misfit", key, "unit"), self.knowledge.units, self.found
            )
            misfit[key] = value["value"] * unit.factor
            if not unit.dimension.fits(VOLUME_FLOW):
                message = f"a misfit is a volume flow; '{unit.text}' does not fit"
                self._report(document.place(*path, "misfit", key, "unit"), "KB073", message)
            if key not in module.type.observers:
                hint = did_you_mean(key, module.type.observers)
                place = document.key(*path, "misfit", key)
                self._report(place, "KB076", f"there is no observer '{key}'", hint)
        valid = {}
        for key, value in part.get("range", {}).items():
            unit = read_unit(
                document, (*path, "range", key, "unit"), self.knowledge.units, self.found
            )
            valid[key] = (unit.to_si(value["from"]), unit.to_si(value["to"]))
            if not value["from"] <= value["to"]:
                spot = document.place(*path, "range", key, "to")
                self._report(spot, "KB055", "the range is empty", "lower end first")
            if key in module.type.signals:
                where = (*path, "range", key, "unit")
                self._check_unit(document, where, unit, module.type.signals[key].unit, "KB073")
            else:
                hint = did_you_mean(key, module.type.signals)
                place = document.key(*path, "range", key)
                self._report(place, "KB071", f"'{module.type.name}' has no signal '{key}'", hint)
        kept = tuple(b for b in blocks if b is not None)
        return replace(module, parameters=parameters, blocks=kept, misfit=misfit, valid=valid)

    def _block(
        self,
        document: Document,
        path: tuple[str | int, ...],
        block: Mapping[str, Any],
        parameters: Mapping[str, Parameter],
    ) -> Block | None:
        """Read a covariance block and factor it; it must be symmetric and positive."""
        place = document.place(*path, "matrix")
        names = tuple(block["of"])
        for i, name in enumerate(names):
            spot = document.place(*path, "of", i)
            if name not in parameters:
                hint = did_you_mean(name, parameters)
                self._report(spot, "KB072", f"there is no parameter '{name}'", hint)
                return None
            if name in names[:i]:
                self._report(spot, "KB049", f"'{name}' stands twice", "keep one")
                return None
        rows = block["matrix"]
        if len(rows) != len(names) or any(len(row) != len(names) for row in rows):
            size = f"{len(names)} row{'s' * (len(names) > 1)} of {len(names)}"
            self._report(place, "KB077", f"this covariance is not {size}", "one for each of 'of'")
            return None
        scale = np.array([parameters[n].unit.factor for n in names])
        matrix = np.array(rows, dtype=float)
        spread = np.sqrt(np.abs(np.diag(matrix)))
        spread[spread == 0] = 1.0
        normal = matrix / np.outer(spread, spread)
        if not np.all(np.isfinite(normal)) or np.max(np.abs(normal - normal.T)) > 1e-6:
            hint = "row i, entry j is row j, entry i"
            self._report(place, "KB078", "this covariance is not symmetric", hint)
            return None
        try:
            factor = np.linalg.cholesky(normal + 1e-12 * np.eye(len(names)))
        except np.linalg.LinAlgError:
            hint = "is a variance below 0, or a correlation beyond 1?"
            self._report(place, "KB079", "this covariance is not positive", hint)
            return None
        factor = factor * (spread * scale)[:, None]
        return Block(names, tuple(tuple(float(f"{v:.12g}") for v in row) for row in factor))

    def fill(self, modules: dict[str, Module]) -> dict[str, Module]:
        """Modules with the fluid that their equations ask for: their own, else the plant's."""
        data, known = self.document.data, self.knowledge.fluids
        named: dict[Path_, str | None]
        named = {("modules", n, "fluid"): m.get("fluid") for n, m in data["modules"].items()}
        for path, fluid in (*named.items(), (("fluid",), data.get("fluid"))):
            if fluid is not None and fluid not in known:
                hint = did_you_mean(fluid, self.fluids)
                self._report(
                    self.document.place(*path), "KB065", f"there is no fluid '{fluid}'", hint
                )
        result = dict(modules)
        for name, module in modules.items():
            if not module.type.asks:
                continue
            fluid = data["modules"][name].get("fluid", data.get("fluid"))
            if fluid in known:
                result[name] = fill(module, known[fluid])
            elif fluid is None:
                asked = " and ".join(module.type.asks)
                message = f"'{module.type.name}' asks for {asked}, but no fluid is named"
                hint = "add 'fluid: ...' to the plant; " + did_you_mean("", self.fluids)
                self._report(self.document.place("modules", name, "type"), "KB066", message, hint)
        return result

    def connections(self, adjacency: tuple[str, str] | None) -> tuple[tuple[str, str], ...]:
        if adjacency is not None:
            if "connections" in self.document.data:
                second = self.document.key("connections")
                message = "connections are given twice: here and as a list"
                self._report(self.document.key("adjacency"), "KB084", message, "keep one", second)
            return self._adjacency(*adjacency)
        result: list[tuple[str, str]] = []
        for i, text in enumerate(self.document.data.get("connections", ())):
            place = self.document.place("connections", i)
            source, target = text.split(" -> ")
            for name, column in ((source, 0), (target, len(source) + 4)):
                if name not in self._names:
                    spot, hint = within(place, column, len(name), text), self._hint(name)
                    self._report(spot, "KB080", f"this plant has no module '{name}'", hint)
            if source == target:
                message = f"'{source}' cannot feed itself directly"
                self._report(place, "KB081", message, "a return needs a module in between")
            elif (source, target) in result:
                second = self.document.place("connections", result.index((source, target)))
                self._report(place, "KB082", f"'{text}' stands twice", "keep one", second)
            result.append((source, target))
        return tuple(result)

    def _adjacency(self, name: str, text: str) -> tuple[tuple[str, str], ...]:
        """Row feeds column where the entry is 1."""
        file = (Path(self.document.path).parent / name).as_posix()
        reader = csv.reader(io.StringIO(text))
        try:
            rows = [(reader.line_num, [c.strip() for c in row]) for row in reader]
        except csv.Error as error:
            self._report(Place(file, reader.line_num), "KB083", f"not a table: {error}")
            return ()
        table = [(line, row) for line, row in rows if any(row)]
        if ";" in text and "," not in text:
            hint = "separate the cells by commas, not by semicolons"
            self._report(Place(file), "KB083", "this table has one column", hint)
            return ()
        first, names = (table[0][0], table[0][1][1:]) if table else (1, [])
        result: list[tuple[str, str]] = []
        self._compare(Place(file, first), names, "column")
        self._compare(Place(file, first), [row[0] for _, row in table[1:]], "row")
        for line, (source, *entries) in table[1:]:
            if len(entries) != len(names) or any(e not in ("", "0", "1") for e in entries):
                message = f"the row of '{source[:40]}' is not {len(names)} times 0 or 1"
                self._report(Place(file, line), "KB083", message)
                continue
            fed = [n for n, e in zip(names, entries, strict=True) if e == "1"]
            if source in fed:
                message = f"'{source}' cannot feed itself directly"
                self._report(Place(file, line), "KB081", message, "write 0 on the diagonal")
            result += [(source, n) for n in fed]
        return tuple(result)

    def _compare(self, place: Place, names: list[str], side: str) -> None:
        """Each module has one row and one column, and nothing else has."""
        for name in sorted({*names, *self._names}):
            if name not in self._names:
                message = f"the {side} '{name[:40]}' is not a module of this plant"
                self._report(place, "KB083", message, self._hint(name))
            elif names.count(name) != 1:
                count = f"{names.count(name)} {side}s" if name in names else f"no {side}"
                message = f"the module '{name}' has {count}"
                self._report(place, "KB083", message)

    def columns(
        self, modules: Mapping[str, Module], document: Document | None
    ) -> tuple[tuple[Column, ...], str]:
        if document is None:
            return (), ""
        result, time_column = [], ""
        for key, part in document.data["columns"].items():
            path = ("columns", key)
            unit = read_unit(document, (*path, "unit"), self.knowledge.units, self.found)
            scale, shift = self._conversion(document, path, part)
            if key == "time":
                time_column = part["from"]
                if unit.dimension.fits(_SECOND) and unit.factor != 1:
                    place = document.place(*path, "unit")
                    message, hint = f"time is read in s, not in {unit.text}", "convert the column"
                    self._report(place, "KB086", message, hint)
                self._check_unit(document, (*path, "unit"), unit, Unit("s", 1, _SECOND), "KB086")
                continue
            module, signal = key.split(".")
            if module in self._names and module not in modules:
                continue
            signals = modules[module].type.signals if module in modules else {}
            if signal not in signals:
                known = [f"{m.name}.{s}" for m in modules.values() for s in m.type.signals]
                message = f"this plant has no signal '{key}'"
                self._report(document.key(*path), "KB085", message, did_you_mean(key, known))
                continue
            self._check_unit(document, (*path, "unit"), unit, signals[signal].unit, "KB086")
            offset = shift * unit.factor + unit.offset
            result.append(Column(key, part["from"], scale * unit.factor, offset))
        return tuple(result), time_column

    def _conversion(
        self, document: Document, path: Path_, part: Mapping[str, Any]
    ) -> tuple[float, float]:
        """Scale and offset by which a number becomes a reading in the unit stated."""
        scale, offset = float(part.get("scale", 1)), float(part.get("offset", 0))
        if path[-1] == "time" and (scale, offset) != (1.0, 0.0):
            key, hint = "scale" if "scale" in part else "offset", "convert the column"
            message = "time is read as it stands in the file, without scale and offset"
            self._report(document.place(*path, key), "KB121", message, hint)
        elif abs(scale) < LEAST_SCALE:
            message = f"with a scale of {scale:g} every number would be the same reading"
            hint = "reading = number*scale + offset, in the unit stated"
            self._report(document.place(*path, "scale"), "KB121", message, hint)
        return scale, offset

    def _check_unit(
        self, document: Document, path: Path_, unit: Unit, wanted: Unit, code: str
    ) -> None:
        if not unit.dimension.fits(wanted.dimension):
            message = f"'{path[-2]}' is in {wanted.text}; '{unit.text}' does not fit"
            self._report(document.place(*path), code, message)
