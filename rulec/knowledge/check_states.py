"""Check the states of a module type: balances, limits, and what sensors show of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from rulec.knowledge.module_type import ENDS, ModuleType, Reading, Signal, State
from rulec.language.diagnostics import Diagnostic, did_you_mean
from rulec.language.document import Document, Path_
from rulec.language.expression import Expression, parse
from rulec.language.part_readers import origin_of, read_expression, read_unit
from rulec.language.units import SECOND, UNKNOWN, Unit, UnitTable


@dataclass
class StateReader:
    """Reads states and readings of one module document; mistakes go to `found`."""

    document: Document
    units: UnitTable
    found: list[Diagnostic] = field(repr=False)

    @property
    def flows(self) -> bool:
        """Do its equations know what flows in and out?"""
        data = self.document.data
        laws = any(end in data.get("definitions", {}) for end in ENDS)
        return laws or "states" in data or "readings" in data

    def states(self) -> dict[str, State]:
        """All states by name."""
        data = self.document.data.get("states", {})
        for group in ("signals", "states", "parameters"):
            for name in ENDS:
                if not self.flows or name not in self.document.data.get(group, {}):
                    continue
                place = self.document.key(group, name)
                message = f"'{name}' is what flows through this module; it cannot be declared"
                hint = "a definition of that name is a law for it"
                self.found.append(Diagnostic(place, "KB110", message, hint))
        return {name: self._state(name) for name in data}

    def _state(self, name: str) -> State:
        path, part = ("states", name), self.document.data["states"][name]
        unit = read_unit(self.document, (*path, "unit"), self.units, self.found)
        wanted = self.units.quantities.get(part.get("quantity", ""))
        if wanted is None and "quantity" in part:
            hint = did_you_mean(part["quantity"], self.units.quantities)
            message = f"there is no quantity '{part['quantity']}'"
            place = self.document.place(*path, "quantity")
            self.found.append(Diagnostic(place, "KB054", message, hint))
        elif wanted is not None and not wanted.fits(unit.dimension):
            message = f"'{unit.text}' is not a unit of {part['quantity']}"
            place = self.document.place(*path, "unit")
            self.found.append(Diagnostic(place, "KB053", message, self.units.like(wanted)))
            unit = replace(unit, dimension=UNKNOWN)
        return State(
            name,
            part.get("quantity", ""),
            unit,
            part.get("title", name),
            read_expression(self.document, (*path, "der"), self.found),
            self._value((*path, "start"), unit),
            self._value((*path, "low"), unit) if "low" in part else None,
            self._value((*path, "high"), unit) if "high" in part else None,
            origin_of(self.document, *path, source=part["source"]),
            self._value((*path, "after"), self.units.plain(SECOND)) if "after" in part else None,
        )

    def _value(self, path: Path_, unit: Unit) -> Expression:
        """An equation, or a bare number in the unit of the state."""
        value = self.document.data["states"][path[1]][path[2]]
        if isinstance(value, (int, float)):
            return parse(repr(unit.to_si(value)))
        return read_expression(self.document, path, self.found)

    def readings(self, signals: Mapping[str, Signal]) -> dict[str, Reading]:
        """What sensors show; each is a signal, and none that is given."""
        result = {}
        for name, part in self.document.data.get("readings", {}).items():
            path = ("readings", name)
            if name not in signals:
                message = f"'{name}' is not a signal of this module"
                hint = did_you_mean(name, signals)
                self.found.append(Diagnostic(self.document.key(*path), "KB035", message, hint))
                continue
            if signals[name].is_input:
                message = f"'{name}' is given ('input: true'), so it has no equation"
                place = self.document.key(*path)
                self.found.append(Diagnostic(place, "KB111", message, "remove one of the two"))
            expression = read_expression(self.document, (*path, "is"), self.found)
            origin = origin_of(self.document, *path, source=part["source"])
            result[name] = Reading(name, expression, origin)
        return result

    def check_still(self, kind: ModuleType) -> None:
        """Observers hold at every moment by themselves: they stand on no state, and no flow."""
        moving = {*kind.states, *ENDS} if kind.flows else set()
        for observer in kind.observers.values():
            parts = kind.with_definitions(observer.expression)
            for name in dict.fromkeys(n for part in parts for n, _ in part.names() if n in moving):
                place = self.document.place("observers", observer.name, "Q")
                message = f"an observer knows no past, but '{observer.name}' stands on '{name}'"
                hint = "read signals; a definition 'inflow' or 'outflow' is a law for a flow"
                self.found.append(Diagnostic(place, "KB116", message, hint))

    @staticmethod
    def equations(
        states: Mapping[str, State], readings: Mapping[str, Reading]
    ) -> Iterator[tuple[Path_, Expression]]:
        """All of their equations with their places."""
        for state in states.values():
            for key, expression in state.equations():
                yield ("states", state.name, key), expression
        for reading in readings.values():
            yield ("readings", reading.name, "is"), reading.expression
