"""Check the joins of an effect: the places it joins, and the law they then have."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rulec_runtime.output.nearest import did_you_mean

from rulec.knowledge.effect import PLAIN, Driver, EffectLaw, Join, parse_law
from rulec.knowledge.module_type import Stored
from rulec.language.expression import Expression, Rejected, constant, rejected_at
from rulec.language.read_yaml import Path_
from rulec.language.reader import Reader
from rulec.language.units import SECOND, UNKNOWN, VOLUME_FLOW, Dimension

TIME = "time"
"""Quantity of a driver that no sensor measures: seconds since the start of the recording."""

ANY = "any"
"""Quantity of a join to every signal."""

_OF_EQUATIONS = ("falls_with", "rises_with", "measured", "steep")
_KINDS = ("gives", "reads", "stores", "shows", "flows")


@dataclass
class JoinReader(Reader):
    """Reads the joins of one effect.

    `drivers` are those declared, `known` the dimensions of drivers and parameters. Parameters
    `of_place` have the dimension of the signal times the given one.
    """

    drivers: Mapping[str, Driver]
    known: Mapping[str, Dimension]
    states: Mapping[str, Stored]
    of_place: Mapping[str, Dimension]

    def read(self, i: int) -> Iterator[Join]:
        """The joins of one entry, one for each quantity."""
        path: Path_ = ("joins", i)
        part = self.part(path)
        kinds = [kind for kind in _KINDS if kind in part]
        if len(kinds) != 1:
            message = f"a join needs one of {', '.join(map(repr, _KINDS))}"
            hint = "gives: equations of this quantity; reads: signals of it; see docs"
            self.report(path, "KB100", message, hint)
            return
        kind, before = kinds[0], len(self.found)
        slopes = self._slopes(part, path)
        law = self._law((*path, "law"))
        also = {end: self._also((*path, "also", end)) for end in part.get("also", {})}
        listed = isinstance(part[kind], list)
        for j, quantity in enumerate(part[kind] if listed else [part[kind]]):
            own = self._dimension_of(kind, (*path, kind, j) if listed else (*path, kind))
            if len(self.found) == before:
                self._check_law_dimension((*path, "law"), law, own)
                self._check_states(own)
            yield Join(
                **{kind: quantity},
                falls_with=slopes.get("falls_with", ""),
                rises_with=slopes.get("rises_with", ""),
                measured=part.get("measured", False),
                law=law,
                steep=part.get("steep"),
                also=also,
            )

    def _slopes(self, part: Mapping[str, Any], path: Path_) -> dict[str, str]:
        """Own drivers whose sign of slope selects places, by key."""
        slopes: dict[str, str] = {}
        for key in _OF_EQUATIONS:
            if "gives" not in part and key in part:
                message, hint = f"a signal is no equation; '{key}' says nothing here", "remove it"
                self.report_key((*path, key), "KB100", message, hint)
            elif key in ("falls_with", "rises_with") and key in part:
                self._check_own_driver(part[key], (*path, key))
                slopes[key] = part[key]
        if "steep" in part and not slopes and "gives" in part:
            message, hint = "steep in which driver?", "add 'falls_with' or 'rises_with'"
            self.report_key((*path, "steep"), "KB100", message, hint)
        return slopes

    def _check_own_driver(self, name: str, path: Path_, column: int | None = None) -> None:
        """Report a driver that is no signal of the module, so that the plain law cannot use it."""
        driver = self.drivers.get(name)
        if driver is None:
            message, hint = f"there is no driver '{name}'", did_you_mean(name, self.drivers)
        elif driver.where not in ("own", "read") or driver.quantity == TIME:
            message = f"'{name}' is no signal of the module, so its equations do not read it"
            hint = "take a driver with 'where: own'"
        else:
            return
        if column is None:
            self.report(path, "KB102", message, hint)
        else:
            self.report_word(path, column, name, "KB102", message, hint)

    def _dimension_of(self, kind: str, path: Path_) -> Dimension:
        """Dimension of a join's law at places of the quantity at a path."""
        if kind == "flows":
            return VOLUME_FLOW
        equations = kind in ("gives", "stores")
        if self.part(path) == ANY and not equations:
            return UNKNOWN
        own = self.quantity(*path, also=() if equations else (ANY,))
        if own is None:
            return UNKNOWN
        return own / SECOND if kind == "stores" else own

    def _also(self, path: Path_) -> EffectLaw:
        before = len(self.found)
        law = self._law(path)
        if len(self.found) == before:
            self._check_law_dimension(path, law, VOLUME_FLOW)
        return law

    def _check_states(self, own: Dimension) -> None:
        """Check that the states have the dimension of their place."""
        known = {**self.known, **dict.fromkeys((PLAIN, *self.states), own), **self._placed(own)}
        for name, state in self.states.items():
            for key, expression in state.equations():
                path = ("states", name, key)
                wanted = {"der": own / SECOND, "after": SECOND}.get(key, own)
                given = self.dimension(path, expression, known)
                if not given.fits(wanted) and constant(expression, {}) is None:
                    message = f"this is {given}, but should be {wanted}"
                    self.report(path, "KB101", message, "check each factor")

    def _placed(self, own: Dimension) -> dict[str, Dimension]:
        """Dimensions of parameters `of_place`, at a signal of dimension `own`."""
        return {name: own * factor for name, factor in self.of_place.items()}

    def _law(self, path: Path_) -> EffectLaw:
        """The law at a path; a refused one is reported and replaced by the plain law.

        Its names must be known, and ``law(...)`` must replace own drivers.
        """
        try:
            law = parse_law(str(self.part(path)))
        except Rejected as error:
            self.report_error(path, error)
            return parse_law(PLAIN)
        self._check_known(
            path, law.expression, {PLAIN, *law.substitutes, *self.known, *self.states}
        )
        for replaced in law.substitutes.values():
            for driver, value in replaced.items():
                at = re.search(rf"\b{driver}\s*=", law.text)
                self._check_own_driver(driver, path, at and at.start())
                self._check_known(path, value, self.known)
        return law

    def _check_known(self, path: Path_, expression: Expression, known: Collection[str]) -> None:
        hint = "declare a driver of that quantity"
        self.check_own(path, expression, "the law of an effect", hint)
        self.check_names(path, expression, known, "driver nor parameter of this effect")

    def _check_law_dimension(self, path: Path_, law: EffectLaw, own: Dimension) -> None:
        """Check the dimension of the law, and of whatever replaces a driver in it."""
        laws = dict.fromkeys((PLAIN, *law.substitutes, *self.states), own)
        known = {**self.known, **laws, **self._placed(own)}
        parts = [(law.expression, own, "the place")]
        for replaced in law.substitutes.values():
            parts += [(value, self.known[n], f"'{n}'") for n, value in replaced.items()]
        before = len(self.found)
        for expression, wanted, what in parts:
            given = self.dimension(path, expression, known)
            if not given.fits(wanted):
                message = f"this is {given}, but {what} is {wanted}"
                self.report_error(
                    path, rejected_at(expression.tree, "KB101", message, "check each factor")
                )
            if len(self.found) > before:
                return
