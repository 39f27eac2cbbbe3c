"""Check an effect: names, parameters, and laws that can be switched off."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec.knowledge.check_join import TIME, JoinReader, needed_by
from rulec.knowledge.effect import PLAIN, Driver, Effect, EffectParameter, EffectState, Join
from rulec.knowledge.try_effect import fails_at_null, is_neutral
from rulec.language.diagnostics import Diagnostic, Place, did_you_mean
from rulec.language.document import Document
from rulec.language.part_readers import origin_of, read_expression, read_unit, within
from rulec.language.units import UNKNOWN, Dimension, Unit, UnitTable

SLOTS = ("module", "place")
"""Slots of a text that every effect has."""

_SLOT = re.compile(r"\{([^{}]*)\}")
_SECOND = Dimension.of({"s": 1})
_OF_FREE = ("unit", "null", "starts", "quantiles", "driver", "range")


def check_effect(document: Document, units: UnitTable, found: list[Diagnostic]) -> Effect:
    """Read an effect; mistakes are added to `found`."""
    return _EffectReader(document, units, found).read()


@dataclass
class _EffectReader:
    """Reads one effect document; `known` are the dimensions of drivers and parameters."""

    document: Document
    units: UnitTable
    found: list[Diagnostic] = field(repr=False)
    known: dict[str, Dimension] = field(default_factory=dict)

    def read(self) -> Effect:
        data, before = self.document.data, len(self.found)
        self._check_names()
        # A law that uses a name which is no name would say the same again.
        of_laws = self.found if len(self.found) == before else []
        drivers = {name: self._driver(name, part) for name, part in self._group("drivers").items()}
        parameters = {
            name: self._parameter(name, part, drivers) for name, part in data["parameters"].items()
        }
        states = {name: self._state(name) for name in self._group("states")}
        reader = JoinReader(self.document, self.units, drivers, self.known, of_laws, states)
        joins = [(i, join) for i in range(len(data["joins"])) for join in reader.read(i)]
        effect = Effect(
            name=data["effect"],
            title=data["title"],
            sort=data["sort"],
            joins=tuple(join for _, join in joins),
            drivers=drivers,
            parameters=parameters,
            regime=data["regime"],
            text=data["text"],
            action=data["action"],
            origin=origin_of(self.document, "effect", source=data["source"]),
            states=states,
        )
        if len(self.found) == before:
            self._check_used(effect, joins)
            self._check_text(effect)
            self._check_null(effect, joins)
        if len(self.found) > before:
            return effect
        neutral = {n: is_neutral(effect, n) for n, p in parameters.items() if p.fixed}
        told = {n: replace(p, neutral=neutral.get(n, False)) for n, p in parameters.items()}
        return replace(effect, parameters=told)

    def _report(self, place: Place, code: str, message: str, hint: str = "") -> None:
        self.found.append(Diagnostic(place, code, message, hint))

    def _group(self, name: str) -> Mapping[str, Any]:
        part: Mapping[str, Any] = self.document.data.get(name, {})
        return part

    def _check_names(self) -> None:
        """Each name means one thing, and the readers of equations and texts can read it."""
        drivers = self._group("drivers")
        for group in ("drivers", "parameters", "states"):
            for name in self._group(group):
                place = self.document.key(group, name)
                if keyword.iskeyword(name):
                    message = f"'{name}' is a reserved word and cannot be a name"
                    hint = "it could not stand in an equation; use another name"
                    self._report(place, "KB024", message, hint)
                twin = group != "drivers" and name in drivers
                if twin or name in (PLAIN, *SLOTS) or name.startswith(f"{PLAIN}_"):
                    second = self.document.key("drivers", name) if twin else None
                    message = f"the name '{name}' means two things"
                    self.found.append(Diagnostic(place, "KB034", message, "rename one", second))

    def _driver(self, name: str, part: Mapping[str, Any]) -> Driver:
        quantity = part["quantity"]
        self.known[name] = self.units.quantities.get(quantity, UNKNOWN)
        if quantity == TIME:
            self.known[name] = _SECOND
        elif quantity not in self.units.quantities:
            hint = did_you_mean(quantity, {*self.units.quantities, TIME})
            place = self.document.place("drivers", name, "quantity")
            self._report(place, "KB054", f"there is no quantity '{quantity}'", hint)
        return Driver(name, quantity, part.get("where", "own"), part.get("title", quantity))

    def _state(self, name: str) -> EffectState:
        """Something that the effect stores; names in its equations are known."""
        path, part = ("states", name), self._group("states")[name]
        equations = {key: read_expression(self.document, (*path, key), self.found) for key in part}
        known = {PLAIN, *self.known, *self._group("states")}
        for key, expression in equations.items():
            for used, column in expression.names():
                if used not in known:
                    place = self.document.place(*path, key)
                    spot = within(place, column, len(used), expression.text)
                    message = f"'{used}' is neither driver, parameter nor state of this effect"
                    self._report(spot, "KB036", message, did_you_mean(used, known))
        return EffectState(
            equations["der"],
            equations["start"],
            equations.get("low"),
            equations.get("high"),
            equations.get("after"),
        )

    def _asked(self, path: tuple[str, ...], name: str, drivers: Mapping[str, Driver]) -> str | None:
        """The driver that a parameter names; None where there is no such one."""
        if name in drivers:
            return name
        place, hint = self.document.place(*path), did_you_mean(name, drivers)
        self._report(place, "KB102", f"there is no driver '{name}'", hint)
        return None

    def _parameter(
        self, name: str, part: Mapping[str, Any], drivers: Mapping[str, Driver]
    ) -> EffectParameter:
        path = ("parameters", name)
        if "of" in part:
            return self._fixed(name, part, drivers)
        unit = self._unit(path) if "unit" in part else Unit("1", 1.0, UNKNOWN)
        self.known[name] = unit.dimension
        lacking = [key for key in ("unit", "range") if key not in part]
        lacking += [] if "starts" in part or "quantiles" in part else ["starts"]
        if lacking:
            message = f"the parameter '{name}' needs {' and '.join(map(repr, lacking))}"
            hint = "or 'of: ...' alone, for the median reading of a driver"
            self._report(self.document.key(*path), "KB103", message, hint)
        low, high = part.get("range", (-math.inf, math.inf))
        starts = tuple(part.get("starts", ()))
        self._check_inside(path, part, low, high)
        driver = self._quantiles(path, part, drivers, unit)
        null = part.get("null")
        return EffectParameter(
            name,
            part["title"],
            unit,
            None if null is None else unit.to_si(null),
            unit.to_si(low),
            unit.to_si(high),
            tuple(unit.to_si(start) for start in starts),
            tuple(part.get("quantiles", ())),
            driver,
            False,
        )

    def _unit(self, path: tuple[str, ...]) -> Unit:
        return read_unit(self.document, (*path, "unit"), self.units, self.found)

    def _fixed(
        self, name: str, part: Mapping[str, Any], drivers: Mapping[str, Driver]
    ) -> EffectParameter:
        """A parameter that stays at the median reading of a driver."""
        odd = [key for key in _OF_FREE if key in part]
        if odd:
            place = self.document.key("parameters", name, odd[0])
            message = f"'{name}' is the median reading of a driver; it has no '{odd[0]}'"
            self._report(place, "KB103", message, "remove it, or remove 'of'")
        driver = self._asked(("parameters", name, "of"), part["of"], drivers)
        self.known[name] = own = self.known[driver] if driver else UNKNOWN
        unit = self.units.plain(own)
        ends = (-math.inf, math.inf)
        return EffectParameter(name, part["title"], unit, None, *ends, (), (), driver, True)

    def _check_inside(
        self, path: tuple[str, ...], part: Mapping[str, Any], low: float, high: float
    ) -> None:
        """The range is one, and null and starts lie in it."""
        if not low < high:
            place = self.document.place(*path, "range")
            self._report(place, "KB055", "the range is empty", "lower end first")
            return
        values: list[tuple[tuple[str | int, ...], float]] = []
        values += [((*path, "starts", i), v) for i, v in enumerate(part.get("starts", ()))]
        values += [((*path, "null"), part["null"])] if "null" in part else []
        for where, value in values:
            if not low <= value <= high:
                message = f"{value:g} is outside of the range"
                hint = f"from {low:g} to {high:g}"
                self._report(self.document.place(*where), "KB104", message, hint)

    def _quantiles(
        self,
        path: tuple[str, ...],
        part: Mapping[str, Any],
        drivers: Mapping[str, Driver],
        unit: Unit,
    ) -> str | None:
        """The driver whose quantiles are tried, which must be of the parameter's kind.

        Where the effect joins signals it may be ``law``, which is what such a signal reads.
        """
        tried = "quantiles" in part
        if tried != ("driver" in part) or (tried and "starts" in part):
            message = f"'{path[-1]}' needs 'starts', or else 'quantiles' and their 'driver'"
            self._report(self.document.key(*path), "KB103", message, "one of the two")
            return None
        if "driver" not in part:
            return None
        signals = all({"reads", "shows"} & join.keys() for join in self.document.data["joins"])
        if part["driver"] == PLAIN and signals:
            return PLAIN
        driver = self._asked((*path, "driver"), part["driver"], drivers)
        if driver and not self.known[driver].fits(unit.dimension):
            message = f"'{unit.text}' is not a unit of {drivers[driver].quantity}"
            hint = self.units.like(self.known[driver])
            self._report(self.document.place(*path, "unit"), "KB053", message, hint)
        return driver

    def _check_used(self, effect: Effect, joins: list[tuple[int, Join]]) -> None:
        """Free parameters stand in every law, drivers and fixed ones in one at least."""
        used = {i: needed_by(join, effect.parameters, effect.states) for i, join in joins}
        everywhere, somewhere = set.intersection(*used.values()), set().union(*used.values())
        for name, parameter in effect.parameters.items():
            if name not in somewhere or not (parameter.fixed or name in everywhere):
                law = "a law" if name in somewhere else "no law"
                verb = "does not use" if name in somewhere else "uses"
                message = f"{law} {verb} the parameter '{name}'"
                hint = "each law needs it; or make two effects"
                hint = hint if name in somewhere else "remove it or use it"
                self._report(self.document.key("parameters", name), "KB038", message, hint)
        for name in effect.drivers:
            if name not in somewhere:
                message = f"nothing uses the driver '{name}'"
                place = self.document.key("drivers", name)
                self._report(place, "KB038", message, "remove it or use it")

    def _check_text(self, effect: Effect) -> None:
        """Slots of the text are known wherever the effect joins."""
        needed = (needed_by(join, effect.parameters, effect.states) for join in effect.joins)
        known = set.intersection(*needed)
        place, text = self.document.place("text"), effect.text
        if re.search("[{}]", _SLOT.sub("", text)):
            message, hint = "a brace in the text has no partner", "write slots as {module}"
            self._report(place, "KB107", message, hint)
        for slot in _SLOT.finditer(text):
            name = slot[1]
            if name not in known and name not in SLOTS:
                some = name in effect.drivers or name in effect.parameters
                message = f"{'not every join has' if some else 'there is no'} '{name}'"
                spot = within(place, slot.start(1), max(1, len(name)), text)
                self._report(spot, "KB107", message, did_you_mean(name, {*known, *SLOTS}))

    def _check_null(self, effect: Effect, joins: list[tuple[int, Join]]) -> None:
        """The plain law comes back at the null of all parameters that have one."""
        if all(parameter.null is None for parameter in effect.parameters.values()):
            message = "this effect has no parameter with a 'null'; nothing switches it off"
            hint = "add 'null: 0' to the one that says how strong it is"
            self._report(self.document.key("parameters"), "KB105", message, hint)
            return
        for i in sorted({i for i, _ in joins}):
            join = next(join for j, join in joins if j == i)
            reason = fails_at_null(effect, join)
            if reason:
                place, hint = self.document.place("joins", i, "law"), "check signs and 'null'"
                self._report(place, "KB106", reason, hint)
