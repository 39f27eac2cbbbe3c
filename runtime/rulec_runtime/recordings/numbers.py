"""Infer from the cells of a file how its numbers are written: decimal sign and thousands marks."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from rulec_runtime.contract.file_form import FileForm

SPACES = " \u00a0\u202f\u2009'\u2019"
"""Thousands marks that are no decimal sign anywhere."""

_SHAPE = re.compile(rf"[+-]?(?P<body>\d[\d.,{SPACES}]*|[.,]\d+)(?:[eE][+-]?\d+)?")
_GROUPS = {
    mark: re.compile(rf"[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+") for mark in f".,{SPACES}"
}


@dataclass(frozen=True)
class Convention:
    """A `decimal` sign, empty if none was found, and marks of `thousands`."""

    decimal: str = ""
    thousands: str = ""

    def plain(self, cell: str) -> str:
        """A number as every program reads it; a cell with wrong groups becomes no number.

        >>> Convention(",", ".").plain("1.234,5"), Convention(",", ".").plain("1.5")
        ('1234.5', '1.5,')
        """
        text = cell.strip()
        for mark in self.thousands:
            if mark in text:
                whole, sign, rest = text.lstrip("+-").partition(self.decimal or "\0")
                if not _GROUPS[mark].fullmatch(whole) or mark in rest:
                    return f"{text},"  # no number in any convention
                minus = "-" if text.startswith("-") else ""
                text = f"{minus}{whole.replace(mark, '')}{sign}{rest}"
        return text.replace(",", ".") if self.decimal == "," else text


UNKNOWN = Convention()


@dataclass
class Signs:
    """Signs found in cells: surely `decimal`, surely of `thousands`, or `either`, each of these
    with its first cell."""

    decimal: set[str] = field(default_factory=set)
    thousands: set[str] = field(default_factory=set)
    either: dict[str, str] = field(default_factory=dict)

    def see(self, cells: Iterable[str]) -> None:
        """Take in further cells."""
        for cell in cells:
            text = cell.strip()
            match = None if text.isdigit() else _SHAPE.fullmatch(text)
            if match is not None:
                self._see(match["body"], text)

    def _see(self, body: str, text: str) -> None:
        spaced = [mark for mark in SPACES if mark in body]
        last = max(body.rfind("."), body.rfind(","))
        if last < 0:
            self.thousands.update(m for m in spaced if _GROUPS[m].fullmatch(body))
            return
        sign = body[last]
        marks = {mark for mark in body[:last] if mark in f".,{SPACES}"}
        if marks == {sign}:
            if _GROUPS[sign].fullmatch(body):
                self.thousands.add(sign)
        elif marks:
            mark = next(iter(marks))
            if len(marks) == 1 and _GROUPS[mark].fullmatch(body[:last]):
                self.decimal.add(sign)
                self.thousands.add(mark)
        elif _GROUPS[sign].fullmatch(body):
            self.either.setdefault(sign, text)
        else:
            self.decimal.add(sign)


def convention_of(own: Signs, file: Signs, form: FileForm, separator: str) -> Convention | str:
    """The convention of a column, by its `own` signs, those of its whole `file`, and the column
    map; or else a cell that could be two numbers.

    >>> german, column = Signs(), Signs()
    >>> german.see(["1,5"]); column.see(["54.054"])
    >>> convention_of(column, german, FileForm(), ";")
    '54.054'
    >>> convention_of(column, german, FileForm(thousands="."), ";")
    Convention(decimal=',', thousands='.')
    """
    if form.decimal or form.thousands:
        stated = form.decimal or ("," if "." in form.thousands else ".")
        return Convention(stated, form.thousands or "".join(sorted(file.thousands - {stated})))
    thousands = {*own.thousands, *(file.thousands & set(SPACES))}
    decimal: str = next(iter(own.decimal)) if len(own.decimal) == 1 else ""
    for sign, cell in own.either.items():
        if decimal or sign in thousands:
            thousands |= {sign} - {decimal}
        elif sign in file.decimal - file.thousands and len(file.decimal) == 1:
            decimal = sign
        elif sign in file.thousands - file.decimal:
            thousands.add(sign)
        elif sign == "." and separator == "," and "," not in file.decimal:
            decimal = sign
        else:
            return cell
    if not decimal and len(file.decimal) == 1 and not file.decimal & thousands:
        decimal = next(iter(file.decimal))
    return Convention(decimal, "".join(sorted(thousands - {decimal})))
