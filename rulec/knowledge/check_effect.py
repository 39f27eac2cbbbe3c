"""Check an effect: its drivers, parameters and states, the places it joins, and its laws there."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.effect import (
    PLAIN,
    USUAL_HINT,
    Driver,
    Effect,
    EffectLaw,
    EffectParameter,
    Join,
    parse_law,
    usual_of,
)
from rulec.knowledge.effect_trials import is_neutral, is_off_at_null
from rulec.knowledge.module_type import Stored
from rulec.language.expression import Expression, Rejected, constant, parse, rejected_at
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import NONE, SECOND, UNKNOWN, VOLUME_FLOW, Dimension, Unit

TIME = "time"
"""Quantity of a driver that no sensor measures: seconds since the start of the recording."""

ANY = "any"
"""Quantity of a join to every signal."""

SLOTS = ("module", "place")
"""Slots that the text of every effect may use."""

_KINDS = ("gives", "reads", "stores", "shows", "flows")
_SLOT = re.compile(r"\{([^{}:]*)(:%)?\}")
_OF_PLACE = re.compile(rf"{PLAIN}(?=$|[*/])")


@dataclass
class EffectReader(Reader):
    """Reads one effect document; `dimensions` holds the dimensions of drivers and parameters.

    Parameters `of_place` have the dimension of the joined signal, times the one given here.
    """

    drivers: Mapping[str, Driver] = field(default_factory=dict)
    states: Mapping[str, Stored] = field(default_factory=dict)
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    of_place: Mapping[str, Dimension] = field(default_factory=dict)

    def read(self) -> Effect:
        """The effect, in SI."""
        data, before = self.document.data, len(self.found)
        groups = ("drivers", "parameters", "states")
        numbered = (n for g in groups for n in self._group(g) if n.startswith(f"{PLAIN}_"))
        self.check_own_names(groups, (PLAIN, *SLOTS, *numbered))
        self.drivers = {n: self._driver(n, part) for n, part in self._group("drivers").items()}
        parameters = {n: self._parameter(n, part) for n, part in data["parameters"].items()}
        self.states = {n: self._state(n, part) for n, part in self._group("states").items()}
        self.of_place = {n: p.unit.dimension for n, p in parameters.items() if p.of_place}
        joins = [(i, join) for i, part in enumerate(data["joins"]) for join in self._joins(i, part)]
        effect = Effect(
            name=data["effect"],
            title=data["title"],
            sort=data["sort"],
            joins=tuple(join for _, join in joins),
            drivers=self.drivers,
            parameters=parameters,
            text=data["text"],
            action=data["action"],
            origin=self.origin("effect", source=data["source"]),
            states=self.states,
        )
        if len(self.found) == before:
            self._check_used(effect)
            self._check_text(effect)
            self._check_null(effect, joins)
        for name, p in parameters.items() if len(self.found) == before else ():
            if p.null is not None and p.usual is None:
                message = f"how large '{name}' usually is is missing"
                self.report_key(("parameters", name), "KB108", message, USUAL_HINT)
        if len(self.found) > before:
            return effect
        # A parameter with two quantiles is a distance between readings, not one of them.
        judged = {
            n: replace(p, neutral=p.fixed and len(p.quantiles) < 2 and is_neutral(effect, n))
            for n, p in parameters.items()
        }
        return replace(effect, parameters=judged)

    def _group(self, name: str) -> Mapping[str, Any]:
        part: Mapping[str, Any] = self.document.data.get(name, {})
        return part

    def _driver(self, name: str, part: Mapping[str, Any]) -> Driver:
        quantity, own = part["quantity"], SECOND
        if quantity != TIME:
            own = self.quantity("drivers", name, "quantity", also=(TIME,)) or UNKNOWN
        self.dimensions[name] = own
        return Driver(name, quantity, part.get("where", "own"), part.get("title", quantity))

    def _state(self, name: str, part: Mapping[str, Any]) -> Stored:
        """A state of the effect; an equation with an unknown name is reported and replaced by 0."""
        names, equations = {PLAIN, *self.dimensions, *self._group("states")}, {}
        for key in part:
            path, before = ("states", name, key), len(self.found)
            expression = self.expression(*path)
            hint = "declare a driver of that quantity"
            self.check_own(path, expression, "a state of an effect", hint)
            what = "driver, parameter nor state of this effect"
            self.check_names(path, expression, names, what)
            equations[key] = expression if len(self.found) == before else parse("0")
        return Stored(rate=equations.pop("der"), **equations)

    def _parameter(self, name: str, part: Mapping[str, Any]) -> EffectParameter:
        """A free parameter, or one fixed at the median of a driver's readings, or their spread."""
        path, quantiles = ("parameters", name), tuple(part.get("quantiles", ()))
        driver = part.get("of", part.get("driver"))
        reads_place = driver == PLAIN and self._joins_signals()
        if driver is not None and not reads_place:
            driver = self._asked((*path, "of" if "of" in part else "driver"), driver)
        own = self.dimensions.get(driver or "", UNKNOWN)
        fixed = "of" in part
        if fixed:
            unit = Unit(PLAIN, 1.0, NONE) if reads_place else self.units.plain(own)
            of_place, self.dimensions[name] = reads_place, own
        else:
            unit, of_place = self._unit((*path, "unit"))
            self.dimensions[name] = UNKNOWN if of_place else unit.dimension
            if driver and not own.fits(unit.dimension):
                message = f"'{unit.text}' is not a unit of {self.drivers[driver].quantity}"
                self.report((*path, "unit"), "KB053", message, self.units.like(own))
            self._check_inside(path, part)
        low, high = part.get("range", (-math.inf, math.inf))
        return EffectParameter(
            name=name,
            title=part["title"],
            unit=unit,
            null=unit.to_si(part["null"]) if "null" in part else None,
            lowest=unit.to_si(low),
            highest=unit.to_si(high),
            starts=tuple(unit.to_si(start) for start in part.get("starts", ())),
            quantiles=quantiles,
            driver=driver,
            fixed=fixed,
            usual=usual_of(part, unit),
            of_place=of_place,
        )

    def _asked(self, path: Path_, name: str) -> str | None:
        """The driver that a parameter names; an unknown one is reported and gives None."""
        exists = self.knows(path, self.drivers, "KB102", "there is no driver '{}'", name)
        return name if exists else None

    def _unit(self, path: Path_) -> tuple[Unit, bool]:
        """The unit of a parameter; whether it begins with ``law``, that of the joined signal."""
        text = self.part(path)
        of_place = _OF_PLACE.match(text)
        if of_place is None:
            return self.unit(*path), False
        if not self._joins_signals():
            message = f"'{PLAIN}' is no unit where the effect joins equations"
            self.report(path, "KB103", message, "take a unit from kb/units.yaml")
        try:
            rest = self.units.parse(f"1{text[of_place.end() :]}")
        except ValueError as error:
            hint = "the spellings are in kb/units.yaml"
            self.report(path, "KB050", f"there is no unit '{error}'", hint)
            rest = Unit("1", 1.0, NONE)
        return replace(rest, text=text), True

    def _joins_signals(self) -> bool:
        """Whether it joins only signals or what sensors show."""
        return all({"reads", "shows"} & join.keys() for join in self.document.data["joins"])

    def _check_inside(self, path: Path_, part: Mapping[str, Any]) -> None:
        """Check the range, and that null and starts lie in it."""
        before, (low, high) = len(self.found), part["range"]
        self.check_range(low, high, *path, "range")
        values = [((*path, "starts", i), v) for i, v in enumerate(part.get("starts", ()))]
        values += [((*path, "null"), part["null"])] if "null" in part else []
        for where, value in values if len(self.found) == before else ():
            if not low <= value <= high:
                message = f"{value:g} is outside of the range"
                self.report(where, "KB104", message, f"from {low:g} to {high:g}")

    def _joins(self, i: int, part: Mapping[str, Any]) -> Iterator[Join]:
        """The joins of one entry, one for each quantity."""
        path: Path_ = ("joins", i)
        kind, before = next(kind for kind in _KINDS if kind in part), len(self.found)
        slopes = {key: part[key] for key in ("falls_with", "rises_with") if key in part}
        for key, name in slopes.items():
            self._check_own_driver((*path, key), name)
        law, also = self._law((*path, "law")), {}
        for end in part.get("also", {}):
            where, mistakes = (*path, "also", end), len(self.found)
            also[end] = self._law(where)
            if len(self.found) == mistakes:
                self._check_dimensions(where, also[end], VOLUME_FLOW)
        listed = isinstance(part[kind], list)
        for j, quantity in enumerate(part[kind] if listed else [part[kind]]):
            own = self._dimension_of(kind, (*path, kind, j) if listed else (*path, kind))
            if len(self.found) == before:
                self._check_dimensions((*path, "law"), law, own)
                self._check_states(own)
            more = {key: part[key] for key in ("measured", "steep") if key in part}
            yield Join(**{kind: quantity}, **slopes, **more, law=law, also=also)

    def _check_own_driver(self, path: Path_, name: str, column: int = 0) -> None:
        """Report a driver that is no signal of the module, so that the plain law cannot use it."""
        message = "there is no driver '{}'"
        if not self.knows(path, self.drivers, "KB102", message, name, column):
            return
        driver = self.drivers[name]
        if driver.where not in ("own", "read") or driver.quantity == TIME:
            message = f"'{name}' is no signal of the module, so its equations do not read it"
            hint = "take a driver with 'where: own'"
            self.report_word(path, column, name, "KB102", message, hint)

    def _dimension_of(self, kind: str, path: Path_) -> Dimension:
        """Dimension of a join's law at places of the quantity at a path."""
        if kind == "flows":
            return VOLUME_FLOW
        equations = kind in ("gives", "stores")
        if self.part(path) == ANY and not equations:
            return UNKNOWN
        own = self.quantity(*path, also=() if equations else (ANY,)) or UNKNOWN
        return own / SECOND if kind == "stores" else own

    def _law(self, path: Path_) -> EffectLaw:
        """The law at a path; a refused one is reported and replaced by the plain law.

        Its names must be known, and ``law(...)`` must replace own drivers.
        """
        try:
            law = parse_law(str(self.part(path)))
        except Rejected as error:
            self.report_error(path, error)
            return parse_law(PLAIN)
        parts: list[tuple[Expression, set[str]]]
        parts = [(law.expression, {PLAIN, *law.substitutes, *self.dimensions, *self.states})]
        for replaced in law.substitutes.values():
            for driver, value in replaced.items():
                at = re.search(rf"\b{driver}\s*=", law.text)
                self._check_own_driver(path, driver, at.start() if at else 0)
                parts.append((value, {*self.dimensions}))
        for expression, names in parts:
            hint = "declare a driver of that quantity"
            self.check_own(path, expression, "the law of an effect", hint)
            self.check_names(path, expression, names, "driver nor parameter of this effect")
        return law

    def _dimensions_at(self, own: Dimension, *laws: str) -> dict[str, Dimension]:
        """Dimensions of all names at a place of dimension `own`; `laws` are further plain laws."""
        there = dict.fromkeys((PLAIN, *laws, *self.states), own)
        return {**self.dimensions, **there, **{n: own * each for n, each in self.of_place.items()}}

    def _check_dimensions(self, path: Path_, law: EffectLaw, own: Dimension) -> None:
        """Check the dimension of a law, and of whatever replaces a driver in it."""
        dimensions, before = self._dimensions_at(own, *law.substitutes), len(self.found)
        parts = [(law.expression, own, "the place")]
        for replaced in law.substitutes.values():
            parts += [(value, self.dimensions[n], f"'{n}'") for n, value in replaced.items()]
        for expression, wanted, what in parts:
            given = self.dimension(path, expression, dimensions)
            if not given.fits(wanted):
                message = f"this is {given}, but {what} is {wanted}"
                error = rejected_at(expression.tree, "KB101", message, "check each factor")
                self.report_error(path, error)
            if len(self.found) > before:
                return

    def _check_states(self, own: Dimension) -> None:
        """Check that the states have the dimension of their place."""
        dimensions = self._dimensions_at(own)
        for name, state in self.states.items():
            for key, expression in state.equations():
                path = ("states", name, key)
                wanted = {"der": own / SECOND, "after": SECOND}.get(key, own)
                given = self.dimension(path, expression, dimensions)
                if not given.fits(wanted) and constant(expression, {}) is None:
                    message = f"this is {given}, but should be {wanted}"
                    self.report(path, "KB101", message, "check each factor")

    def _check_used(self, effect: Effect) -> None:
        """Check that each law uses all free parameters, and some law each driver and fixed one."""
        used = [effect.needed_by(join) for join in effect.joins]
        everywhere, somewhere = set.intersection(*used), set().union(*used)
        for name, parameter in effect.parameters.items():
            path = ("parameters", name)
            if name not in somewhere:
                message = f"no law uses the parameter '{name}'"
                self.report_key(path, "KB038", message, "remove it or use it")
            elif not (parameter.fixed or name in everywhere):
                message = f"a law does not use the parameter '{name}'"
                self.report_key(path, "KB038", message, "each law needs it; or make two effects")
        for name in effect.drivers:
            if name not in somewhere:
                message = f"nothing uses the driver '{name}'"
                self.report_key(("drivers", name), "KB038", message, "remove it or use it")

    def _check_text(self, effect: Effect) -> None:
        """Check that the slots of the text are known wherever the effect joins."""
        names = {*SLOTS, *set.intersection(*(effect.needed_by(join) for join in effect.joins))}
        if re.search("[{}]", _SLOT.sub("", effect.text)):
            message, hint = "a brace in the text has no partner", "write slots as {module}"
            self.report(("text",), "KB107", message, hint)
        for slot in _SLOT.finditer(effect.text):
            name, parameter = slot[1], effect.parameters.get(slot[1])
            if name not in names:
                some = name in effect.drivers or name in effect.parameters
                message = f"{'not every join has' if some else 'there is no'} '{name}'"
                hint = did_you_mean(name, names)
            elif slot[2] and not (parameter and parameter.unit.text.startswith("1")):
                message, hint = f"'{name}' is not a fraction", "':%' needs a unit such as 1 or 1/K"
            else:
                continue
            self.report_word(("text",), slot.start(1), name, "KB107", message, hint)

    def _check_null(self, effect: Effect, joins: list[tuple[int, Join]]) -> None:
        """Check that the law reduces to the plain law if all parameters are at their null."""
        for i, join in dict(reversed(joins)).items():  # the first join of each entry
            is_off = is_off_at_null(effect, join)
            if not is_off:
                what = (
                    "is mostly no number" if is_off is None else "does not give the plain law back"
                )
                message = f"with all parameters at their null this {what}"
                self.report(("joins", i, "law"), "KB106", message, "check signs and 'null'")
