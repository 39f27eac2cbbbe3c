"""Check the states of a module type: balances, limits, and what sensors show of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.module_type import ENDS, ModuleType, Reading, Signal, State
from rulec.language.document import Path_
from rulec.language.expression import Expression, parse
from rulec.language.reader import Reader
from rulec.language.units import SECOND, Unit


@dataclass
class StateReader(Reader):
    """Reads states and readings of one module document."""

    @property
    def flows(self) -> bool:
        """Whether its equations can use inflow and outflow."""
        data = self.document.data
        laws = any(end in data.get("definitions", {}) for end in ENDS)
        return laws or "states" in data or "readings" in data

    def states(self) -> dict[str, State]:
        """All states by name."""
        for group in ("signals", "states", "parameters"):
            for name in ENDS:
                if self.flows and name in self.document.data.get(group, {}):
                    message = f"'{name}' is what flows through this module; it cannot be declared"
                    hint = "a definition of that name is a law for it"
                    self.report_key((group, name), "KB110", message, hint)
        return {name: self._state(name) for name in self.document.data.get("states", {})}

    def _state(self, name: str) -> State:
        path, part = ("states", name), self.document.data["states"][name]
        unit = self.measured_unit(path)
        seconds = self.units.plain(SECOND)
        return State(
            name=name,
            quantity=part.get("quantity", ""),
            unit=unit,
            title=part.get("title", name),
            rate=self.expression(*path, "der"),
            start=self._value((*path, "start"), unit),
            low=self._value((*path, "low"), unit) if "low" in part else None,
            high=self._value((*path, "high"), unit) if "high" in part else None,
            after=self._value((*path, "after"), seconds) if "after" in part else None,
            origin=self.origin(*path, source=part["source"]),
        )

    def _value(self, path: Path_, unit: Unit) -> Expression:
        """An equation, or a bare number in the unit of the state."""
        value = self.part(path)
        if isinstance(value, (int, float)):
            return parse(repr(unit.to_si(value)))
        return self.expression(*path)

    def readings(self, signals: Mapping[str, Signal]) -> dict[str, Reading]:
        """Equations of what sensors show; each must be a signal that is no input."""
        result = {}
        for name, part in self.document.data.get("readings", {}).items():
            path = ("readings", name)
            if name not in signals:
                message = f"'{name}' is not a signal of this module"
                self.report_key(path, "KB035", message, did_you_mean(name, signals))
                continue
            if signals[name].is_input:
                message = f"'{name}' is given ('input: true'), so it has no equation"
                self.report_key(path, "KB111", message, "remove one of the two")
            expression = self.expression(*path, "is")
            result[name] = Reading(name, expression, self.origin(*path, source=part["source"]))
        return result

    def check_still(self, kind: ModuleType) -> None:
        """Check that observers use no states or flows: they must hold at each moment alone."""
        moving = {*kind.states, *ENDS} if kind.flows else set()
        for observer in kind.observers.values():
            for name in kind.names_through(observer.expression) & moving:
                message = f"an observer knows no past, but '{observer.name}' stands on '{name}'"
                hint = "read signals; a definition 'inflow' or 'outflow' is a law for a flow"
                self.report(("observers", observer.name, "Q"), "KB116", message, hint)
