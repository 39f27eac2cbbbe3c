"""Reads the parts of one document, and reports mistakes at their places."""

import contextlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rulec_runtime.contract.unit_text import plain_text
from rulec_runtime.output.nearest import did_you_mean, nearest

from rulec.language.diagnostics import Diagnostic, Origin, Place
from rulec.language.dimension import dimension
from rulec.language.expression import Expression, Rejected, parse
from rulec.language.read_yaml import Document, Path_
from rulec.language.units import UNKNOWN, Dimension, Unit, UnitTable

_SPELLINGS = "the spellings are in kb/units.yaml; others go into a units.yaml of your own"


@dataclass
class Reader:
    """Reads one document; each mistake is added to `found`, with its place.

    A *path* consists of the keys that lead to a part, such as ``("signals", "dp", "unit")``.
    """

    document: Document
    units: UnitTable
    found: list[Diagnostic] = field(repr=False)

    @property
    def is_refused(self) -> bool:
        """Whether a mistake has been found in this document."""
        return any(d.place.file == self.document.path for d in self.found)

    def part(self, path: Path_) -> Any:
        """The data at a path; raises KeyError if there is none."""
        part = self.document.data
        for step in path:
            part = part[step]
        return part

    def origin(self, *path: str | int, source: str = "") -> Origin:
        """Where a part comes from."""
        return Origin(self.document.label, self.document.key(*path).line, source)

    def report(
        self, path: Path_, code: str, message: str, hint: str = "", second: Place | None = None
    ) -> None:
        """Report a mistake in the value at a path."""
        self.found.append(Diagnostic(self.document.place(*path), code, message, hint, second))

    def report_key(
        self, path: Path_, code: str, message: str, hint: str, second: Place | None = None
    ) -> None:
        """Report a mistake in the key at a path, or in its content."""
        self.found.append(Diagnostic(self.document.key(*path), code, message, hint, second))

    def report_word(
        self, path: Path_, column: int, word: str, code: str, message: str, hint: str
    ) -> None:
        """Report a mistake in one word of the text at a path; `column` counts from 0."""
        self.report_error(path, Rejected(code, column, message, hint, max(1, len(word))))

    def report_error(self, path: Path_, error: Rejected) -> None:
        """Report a mistake in the text at a path."""
        place, text = self.document.place(*path), str(self.part(path))
        quotes = place.length - len(text)
        if quotes in (0, 2):  # else the text has several lines or escapes and is marked as a whole
            column = place.column + quotes // 2 + error.column
            place = Place(place.file, place.line, column, error.length)
        self.found.append(Diagnostic(place, error.code, error.message, error.hint))

    def knows(
        self, path: Path_, names: Collection[str], code: str, message: str, name: str = "",
        column: int = 0,
    ) -> bool:  # fmt: skip
        """Whether a name is known; if not, it is reported with the nearest known one.

        It is a word of the text at the path, from `column` on, or else the key that ends the path.
        In `message`, ``{}`` is the name.
        """
        word = name or str(path[-1])
        if word in names:
            return True
        text, hint = message.replace("{}", word), did_you_mean(word, names)
        if name:
            self.report_word(path, column, name, code, text, hint)
        else:
            self.report_key(path, code, text, hint)
        return False

    def unit(self, *path: str | int, dimension: Dimension = UNKNOWN) -> Unit:
        """The unit at a path; an unknown one is reported and then fits every dimension.

        Only units of the dimension, if it is known, are proposed instead.
        """
        text = self.part(path)
        try:
            return self.units.parse(text)
        except ValueError as error:
            name = str(error)
        fitting = [n for n, u in self.units.units.items() if u.dimension.fits(dimension)]
        near, plain = nearest(name, fitting if name == text else self.units.units), plain_text(text)
        hint = f"did you mean '{near}'?" if near else _SPELLINGS
        with contextlib.suppress(ValueError):
            hint = f"write '{self.units.parse(plain).text}'"
        message = f"there is no unit '{name[:40]}'"
        if name == text:
            self.report(path, "KB050", message, hint)
        else:
            self.report_word(path, text.find(name), name, "KB050", message, hint)
        return Unit(text, 1.0, UNKNOWN)

    def unit_of(self, dimension: Dimension, what: str, *path: str | int) -> Unit:
        """The unit at a path; a wrong dimension is reported, and the unit then fits every one."""
        unit = self.unit(*path, dimension=dimension)
        if unit.dimension.fits(dimension):
            return unit
        message = f"'{unit.text}' is not a unit of {what}"
        self.report(path, "KB053", message, self.units.like(dimension))
        return replace(unit, dimension=UNKNOWN)

    def quantity(self, *path: str | int, also: Iterable[str] = ()) -> Dimension | None:
        """Dimension of the quantity at a path; an unknown one is reported and gives None."""
        name = self.part(path)
        found = self.units.quantities.get(name)
        if found is None:
            hint = did_you_mean(name, {*self.units.quantities, *also})
            self.report(path, "KB054", f"there is no quantity '{name}'", hint)
        return found

    def measured_unit(self, path: Path_) -> Unit:
        """The unit of a part, which must fit its ``quantity``; without one, every unit fits."""
        if "quantity" not in self.part(path):
            return self.unit(*path, "unit")
        quantity = self.quantity(*path, "quantity")
        name = self.part((*path, "quantity"))
        return self.unit_of(UNKNOWN if quantity is None else quantity, name, *path, "unit")

    def check_own_names(self, groups: Iterable[str], taken: Iterable[str] = ()) -> None:
        """Report names in groups of the document that mean two things; `taken` have a meaning."""
        first: dict[str, Place | None] = dict.fromkeys(taken)
        for group in groups:
            for name in self.document.data.get(group, {}):
                if name in first:
                    message = f"the name '{name}' means two things"
                    self.report_key((group, name), "KB034", message, "rename one", first[name])
                first.setdefault(name, self.document.key(group, name))

    def check_range(self, low: float, high: float, *path: str | int) -> None:
        """Report a range whose lower end is not below its upper end."""
        if not low < high:
            self.report(path, "KB055", "the range is empty", "lower end first")

    def expression(self, *path: str | int) -> Expression:
        """The equation at a path; a refused one is reported and replaced by 0."""
        try:
            return parse(str(self.part(path)))
        except Rejected as error:
            self.report_error(path, error)
            return parse("0")

    def check_names(
        self, path: Path_, expression: Expression, names: Collection[str], what: str
    ) -> None:
        """Report unknown names in an equation; `what` says what they could be."""
        for name, column in expression.names():
            self.knows(path, names, "KB036", f"'{{}}' is neither {what}", name, column)

    def check_own(self, path: Path_, expression: Expression, what: str, hint: str) -> None:
        """Report fluid properties and downstream sums in an equation that cannot use them."""
        for name, column in (*expression.properties(), *expression.gathered()):
            message = f"'{name}' cannot be asked for in {what}"
            self.report_word(path, column, name, "KB044", message, hint)

    def dimension(
        self,
        path: Path_,
        expression: Expression,
        dimensions: Mapping[str, Dimension],
        gathered: Mapping[str, Dimension] | None = None,
    ) -> Dimension:
        """Dimension of an equation; a misfit is reported and gives `UNKNOWN`."""
        try:
            return dimension(expression, dimensions, gathered or {})
        except Rejected as error:
            self.report_error(path, error)
            return UNKNOWN
