"""Check the joins of an effect: which places, and the law they then have."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from rulec.knowledge.effect import PLAIN, Driver, EffectLaw, EffectParameter, EffectState, Join
from rulec.knowledge.effect_law import Columns, parse_law
from rulec.language.diagnostics import Diagnostic, Place, did_you_mean
from rulec.language.dimension import dimension
from rulec.language.document import Document, Path_
from rulec.language.expression import Expression, Rejected, constant
from rulec.language.part_readers import within
from rulec.language.units import UNKNOWN, VOLUME_FLOW, Dimension, UnitTable

TIME = "time"
"""Quantity of a driver that no sensor measures: seconds since the recording began."""

ANY = "any"
"""Quantity of a join to every signal."""

_OF_EQUATIONS = ("falls_with", "rises_with", "measured", "steep")
_KINDS = ("gives", "reads", "stores", "shows", "flows")
_SECOND = Dimension.of({"s": 1})


def needed_by(
    join: Join, parameters: Mapping[str, EffectParameter], states: Mapping[str, EffectState]
) -> set[str]:
    """Drivers and parameters that a join needs."""
    names = {name for law in join.laws for name in law.names()}
    names |= {name for state in states.values() for name in state.names()}
    names |= {name for name in (join.falls_with, join.rises_with) if name}
    names |= {p.driver for n, p in parameters.items() if n in names and p.driver}
    return names - {PLAIN, *states}


@dataclass
class JoinReader:
    """Reads the joins of one effect.

    `drivers` are those declared, `known` the dimensions of drivers and parameters; mistakes go to
    `found`.
    """

    document: Document
    units: UnitTable
    drivers: Mapping[str, Driver]
    known: Mapping[str, Dimension]
    found: list[Diagnostic] = field(repr=False)
    states: Mapping[str, EffectState] = field(default_factory=dict)

    def read(self, i: int) -> Iterator[Join]:
        """The joins that one entry lists: one for each quantity."""
        part, path = self.document.data["joins"][i], ("joins", i)
        kinds = [kind for kind in _KINDS if kind in part]
        if len(kinds) != 1:
            message = f"a join needs one of {', '.join(map(repr, _KINDS))}"
            hint = "gives: equations of this quantity; reads: signals of it; see docs"
            self._report(self.document.place(*path), "KB100", message, hint)
            return
        kind, before = kinds[0], len(self.found)
        slopes = self._slopes(part, path)
        law, columns = self._law((*path, "law"))
        self._check_names((*path, "law"), law, columns)
        also = {end: self._also((*path, "also", end)) for end in part.get("also", {})}
        listed = isinstance(part[kind], list)
        for j, quantity in enumerate(part[kind] if listed else [part[kind]]):
            own = self._dimension_of(kind, (*path, kind, j) if listed else (*path, kind), quantity)
            if len(self.found) == before:
                self._check_dimension((*path, "law"), law, columns, own)
                self._check_states(own)
            named = {k: quantity if k == kind else "" for k in _KINDS}
            yield Join(
                reads=named["reads"],
                gives=named["gives"],
                falls_with=slopes.get("falls_with", ""),
                rises_with=slopes.get("rises_with", ""),
                measured=part.get("measured", False),
                law=law,
                steep=part.get("steep"),
                stores=named["stores"],
                shows=named["shows"],
                flows=named["flows"],
                also=also,
            )

    def _report(self, place: Place, code: str, message: str, hint: str = "") -> None:
        self.found.append(Diagnostic(place, code, message, hint))

    def _slopes(self, part: Mapping[str, Any], path: Path_) -> dict[str, str]:
        """Own drivers by which the slope of a place is asked for."""
        slopes: dict[str, str] = {}
        for key in _OF_EQUATIONS:
            if "gives" not in part and key in part:
                message, hint = f"a signal is no equation; '{key}' says nothing here", "remove it"
                self._report(self.document.key(*path, key), "KB100", message, hint)
            elif key in ("falls_with", "rises_with") and key in part:
                self._check_own(part[key], self.document.place(*path, key))
                slopes[key] = part[key]
        if "steep" in part and not slopes and "gives" in part:
            message, hint = "steep in which driver?", "add 'falls_with' or 'rises_with'"
            self._report(self.document.key(*path, "steep"), "KB100", message, hint)
        return slopes

    def _check_own(self, name: str, place: Place) -> None:
        """Only signals of the module itself can the plain law depend on."""
        driver = self.drivers.get(name)
        if driver is None:
            hint = did_you_mean(name, self.drivers)
            self._report(place, "KB102", f"there is no driver '{name}'", hint)
        elif driver.where not in ("own", "read") or driver.quantity == TIME:
            message = f"'{name}' is no signal of the module, so its equations do not read it"
            self._report(place, "KB102", message, "take a driver with 'where: own'")

    def _dimension_of(self, kind: str, path: Path_, quantity: str) -> Dimension:
        if kind == "flows":
            return VOLUME_FLOW
        if quantity in self.units.quantities:
            own = self.units.quantities[quantity]
            return own / _SECOND if kind == "stores" else own
        if kind in ("gives", "stores") or quantity != ANY:
            also = () if kind in ("gives", "stores") else (ANY,)
            hint = did_you_mean(quantity, {*self.units.quantities, *also})
            message = f"there is no quantity '{quantity}'"
            self._report(self.document.place(*path), "KB054", message, hint)
        return UNKNOWN

    def _also(self, path: Path_) -> EffectLaw:
        """A law for a further flow, checked."""
        before = len(self.found)
        law, columns = self._law(path)
        self._check_names(path, law, columns)
        if len(self.found) == before:
            self._check_dimension(path, law, columns, VOLUME_FLOW)
        return law

    def _check_states(self, own: Dimension) -> None:
        """What an effect stores is of the kind of its place."""
        known = {**self.known, **dict.fromkeys((PLAIN, *self.states), own)}
        for name, state in self.states.items():
            for key, expression in state.equations():
                path = ("states", name, key)
                wanted = {"der": own / _SECOND, "after": _SECOND}.get(key, own)
                try:
                    given = dimension(expression, known, {})
                except Rejected as error:
                    self._report_in(path, expression.text, error)
                    continue
                if not given.fits(wanted) and constant(expression, {}) is None:
                    message = f"this is {given}, but should be {wanted}"
                    self._report(self.document.place(*path), "KB101", message, "check each factor")

    def _law(self, path: Path_) -> tuple[EffectLaw, Columns]:
        """Read the law at a path; a refused one is reported and counts as the plain law."""
        part = self.document.data
        for step in path:
            part = part[step]
        text = str(part)
        try:
            return parse_law(text)
        except Rejected as error:
            self._report_in(path, text, error)
            return parse_law(PLAIN)

    def _report_in(self, path: Path_, text: str, error: Rejected, shift: int = 0) -> None:
        place = within(self.document.place(*path), shift + error.column, error.length, text)
        self._report(place, error.code, error.message, error.hint)

    def _check_names(self, path: Path_, law: EffectLaw, columns: Columns) -> None:
        """All names of a law are known, and what ``law(...)`` replaces is an own driver."""
        place = self.document.place(*path)
        known = {PLAIN, *law.substitutes, *self.known, *self.states}
        self._check_known(place, law, law.expression, 0, known)
        for key, replaced in law.substitutes.items():
            for driver, value in replaced.items():
                at, start = columns[key, driver]
                self._check_own(driver, within(place, at, len(driver), law.text))
                self._check_known(place, law, value, start, self.known)

    def _check_known(
        self,
        place: Place,
        law: EffectLaw,
        expression: Expression,
        shift: int,
        known: Iterable[str],
    ) -> None:
        for name, column in (*expression.properties(), *expression.gathered()):
            spot = within(place, shift + column, len(name), law.text)
            message = f"'{name}' cannot be asked for in the law of an effect"
            self._report(spot, "KB044", message, "declare a driver of that quantity")
        for name, column in expression.names():
            if name not in known:
                spot = within(place, shift + column, len(name), law.text)
                message = f"'{name}' is neither driver nor parameter of this effect"
                self._report(spot, "KB036", message, did_you_mean(name, known))

    def _check_dimension(
        self, path: Path_, law: EffectLaw, columns: Columns, own: Dimension
    ) -> None:
        """The law gives what its place gives, and what replaces a driver is of its kind."""
        known = {**self.known, **dict.fromkeys((PLAIN, *law.substitutes, *self.states), own)}
        parts = [(law.expression, 0, own, "the place")]
        for key, replaced in law.substitutes.items():
            parts += [
                (value, columns[key, driver][1], self.known[driver], f"'{driver}'")
                for driver, value in replaced.items()
            ]
        for expression, shift, wanted, what in parts:
            try:
                given = dimension(expression, known, {})
            except Rejected as error:
                self._report_in(path, law.text, error, shift)
                return
            if not given.fits(wanted) and constant(expression, {}) != 0:
                message = f"this is {given}, but {what} is {wanted}"
                spot = within(self.document.place(*path), shift, len(expression.text), law.text)
                self._report(spot, "KB101", message, "check each factor")
                return
