"""Pass 2b, check plant: the plant's documents against the knowledge, all values in SI."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rulec.check_knowledge import check_knowledge
from rulec.diagnostics import Diagnostic, Place, Refused, did_you_mean
from rulec.document import Document
from rulec.knowledge import Knowledge, ModuleType, Parameter
from rulec.part_readers import origin_of, read_unit
from rulec.plant import Block, Column, Module, Plant
from rulec.read import Sources
from rulec.units import Unit


def check(sources: Sources) -> Plant:
    """Check knowledge and plant; raises `Refused` with every mistake of meaning."""
    return check_plant(sources, check_knowledge(sources))


def check_plant(sources: Sources, knowledge: Knowledge) -> Plant:
    """Check a plant against checked knowledge."""
    document = sources.plant
    assert document is not None
    reader = _PlantReader(document, knowledge)
    modules = reader.modules()
    for calibration in sources.calibrations:
        modules = reader.calibrate(modules, calibration)
    connections = reader.connections(modules, sources.adjacency)
    columns, time_column = reader.columns(modules, sources.columns)
    if reader.found:
        raise Refused(reader.found)
    return Plant(
        document.data["plant"],
        document.data["title"],
        modules,
        connections,
        columns,
        time_column,
        knowledge,
        sources.digest(),
        document.place("plant"),
    )


@dataclass
class _PlantReader:
    document: Document
    knowledge: Knowledge
    found: list[Diagnostic] = field(default_factory=list)

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
                hint = did_you_mean(part["type"], self.knowledge.modules)
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
        return Module(name, title, kind, parameters, (), {}, {}, reference)

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
        if unit.dimension != known.unit.dimension:
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
            if name not in modules:
                hint = did_you_mean(name, modules)
                message = f"this plant has no module '{name}'"
                self._report(document.key(*path), "KB074", message, hint)
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
            if key not in module.type.signals:
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
            if name not in parameters:
                spot = document.place(*path, "of", i)
                hint = did_you_mean(name, parameters)
                self._report(spot, "KB072", f"there is no parameter '{name}'", hint)
                return None
        rows = block["matrix"]
        if len(rows) != len(names) or any(len(row) != len(names) for row in rows):
            message = f"a covariance of {len(names)} parameters has {len(names)} rows and columns"
            self._report(place, "KB077", message)
            return None
        scale = np.array([parameters[n].unit.factor for n in names])
        matrix = np.array(rows, dtype=float)
        spread = np.sqrt(np.abs(np.diag(matrix)))
        spread[spread == 0] = 1.0
        normal = matrix / np.outer(spread, spread)
        if not np.all(np.isfinite(normal)) or np.max(np.abs(normal - normal.T)) > 1e-6:
            self._report(place, "KB078", "this covariance is not symmetric")
            return None
        try:
            factor = np.linalg.cholesky(normal + 1e-12 * np.eye(len(names)))
        except np.linalg.LinAlgError:
            self._report(
                place, "KB079", "this covariance is not positive", "a variance is below 0?"
            )
            return None
        factor = factor * (spread * scale)[:, None]
        return Block(names, tuple(tuple(float(f"{v:.12g}") for v in row) for row in factor))

    def connections(
        self, modules: Mapping[str, Module], adjacency: tuple[str, str] | None
    ) -> tuple[tuple[str, str], ...]:
        if adjacency is not None:
            if "connections" in self.document.data:
                second = self.document.key("connections")
                message = "connections are given twice: here and as a list"
                self._report(self.document.key("adjacency"), "KB084", message, "keep one", second)
            return self._adjacency(modules, adjacency[1])
        result: list[tuple[str, str]] = []
        for i, text in enumerate(self.document.data.get("connections", ())):
            place = self.document.place("connections", i)
            source, target = text.split(" -> ")
            for name in (source, target):
                if name not in self.document.data["modules"]:
                    hint = did_you_mean(name, modules)
                    self._report(place, "KB080", f"this plant has no module '{name}'", hint)
            if source == target:
                self._report(place, "KB081", f"'{source}' cannot feed itself directly")
            elif (source, target) in result:
                second = self.document.place("connections", result.index((source, target)))
                self._report(place, "KB082", f"'{text}' stands twice", "keep one", second)
            result.append((source, target))
        return tuple(result)

    def _adjacency(self, modules: Mapping[str, Module], text: str) -> tuple[tuple[str, str], ...]:
        """Row feeds column where the entry is 1."""
        place = self.document.place("adjacency")
        rows = [row for row in csv.reader(io.StringIO(text)) if any(c.strip() for c in row)]
        names = [c.strip() for c in rows[0][1:]] if rows else []
        result = []
        wrong = sorted(set(names) ^ set(modules))
        if wrong:
            message = f"the adjacency matrix and the modules differ in '{wrong[0]}'"
            self._report(place, "KB083", message, did_you_mean(wrong[0], modules))
            return ()
        for row in rows[1:]:
            source, entries = row[0].strip(), [c.strip() for c in row[1:]]
            legal = source in modules and len(entries) == len(names)
            if not legal or any(e not in ("", "0", "1") for e in entries):
                message = (
                    f"the adjacency matrix row '{source[:40]}' is not {len(names)} times 0 or 1"
                )
                self._report(place, "KB083", message)
                continue
            result += [(source, n) for n, e in zip(names, entries, strict=True) if e == "1"]
        return tuple(result)

    def columns(
        self, modules: Mapping[str, Module], document: Document | None
    ) -> tuple[tuple[Column, ...], str]:
        if document is None:
            return (), ""
        result, time_column = [], ""
        for key, part in document.data["columns"].items():
            path = ("columns", key)
            unit = read_unit(document, (*path, "unit"), self.knowledge.units, self.found)
            if key == "time":
                time_column = part["from"]
                continue
            module, signal = key.split(".")
            signals = modules[module].type.signals if module in modules else {}
            if signal not in signals:
                known = [f"{m.name}.{s}" for m in modules.values() for s in m.type.signals]
                message = f"this plant has no signal '{key}'"
                self._report(document.key(*path), "KB085", message, did_you_mean(key, known))
                continue
            self._check_column(document, (*path, "unit"), unit, signals[signal].unit)
            result.append(Column(key, part["from"], unit.factor, unit.offset))
        return tuple(result), time_column

    def _check_column(
        self, document: Document, path: tuple[str | int, ...], unit: Unit, wanted: Unit
    ) -> None:
        if unit.dimension != wanted.dimension:
            message = f"the signal is in {wanted.text}; '{unit.text}' does not fit"
            self._report(document.place(*path), "KB086", message)
