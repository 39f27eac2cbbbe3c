"""Check states (balances, limits, what sensors show of them) and regimes of a module type."""

import ast
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from rulec.knowledge.module_type import ENDS, Comparison, ModuleType, Reading, Regime, Signal, State
from rulec.language.expression import (
    Expression,
    Rejected,
    checked,
    parse,
    rejected_at,
    syntax_tree,
    text_of,
)
from rulec.language.read_yaml import Path_
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
            if not self.knows(path, signals, "KB035", "'{}' is not a signal of this module"):
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


MINIMUM = "minimum"
"""In a comparison: the smallest reading at which the equations hold."""


@dataclass
class RegimeReader(Reader):
    """Reads the regimes of one module document; `known` are the names they may use."""

    signals: Mapping[str, Signal]
    known: Collection[str]

    def regimes(self) -> dict[str, Regime]:
        """All regimes by name."""
        found = {}
        for name, part in self.document.data.get("regimes", {}).items():
            path: Path_ = ("regimes", name)
            compared = (self._comparison((*path, "when", i)) for i in range(len(part["when"])))
            found[name] = Regime(
                name=name,
                title=part["title"],
                when=tuple(c for c in compared if c is not None),
                status=part["status"],
                text=part["text"],
                action=part["action"],
                origin=self.origin(*path, source=part["source"]),
            )
        return found

    def _comparison(self, path: Path_) -> Comparison | None:
        """A comparison such as ``loss < 0``; a mistake is reported and gives None."""
        text: str = self.part(path)
        before = len(self.found)
        try:
            tree = syntax_tree(text, also="<>")
            match tree:
                case ast.Compare(ops=[ast.Gt() | ast.Lt()], left=left, comparators=[right]):
                    above = isinstance(tree.ops[0], ast.Gt)
                case _:
                    raise rejected_at(tree, "KB041", "this does not compare two values")
            if isinstance(right, ast.Name) and right.id == MINIMUM:
                return self._with_minimum(path, text, text_of(left), above=above)
            more, less = (left, right) if above else (right, left)
            margin = checked(ast.copy_location(ast.BinOp(more, ast.Sub(), less), tree))
        except Rejected as error:
            self.report_error(path, error)
            return None
        what = "signal, parameter nor definition of this module"
        self.check_names(path, margin, self.known, what)
        self.check_own(path, margin, "a regime", "give it a definition")
        return Comparison(text, margin) if len(self.found) == before else None

    def _with_minimum(self, path: Path_, text: str, name: str, *, above: bool) -> Comparison | None:
        signal = self.signals.get(name)
        if signal is None or signal.minimum is None:
            message = f"'{name}' is no signal of this module with a minimum"
            self.report(path, "KB126", message, "give the signal a 'minimum'")
            return None
        return Comparison(text, parse("0"), name, above)
