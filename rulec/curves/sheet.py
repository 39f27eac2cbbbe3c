"""A table of points, as printed by a maker or read off a picture.

Titles of columns and tolerances of acceptance grades come from `words.yaml`."""

import functools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import one_line
from rulec_runtime.recordings.formats import opened_table
from rulec_runtime.recordings.titles import is_value, parts_of

from rulec.curves.limits import MOST_SHEET_POINTS
from rulec.knowledge.module_type import Accuracy
from rulec.language.units import Dimension, Unit, UnitTable

_IN_BRACKETS = re.compile(r"(?P<name>[^()]+?)\s*\((?P<unit>[^()]+)\)")
_SUPERSCRIPTS = str.maketrans({"²": "2", "³": "3", "·": "*"})


class CurveRefused(Refusal):
    """The points cannot be used; the message says why and what to do."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a sheet: `values` in SI, shape (n,), NaN where the sheet has none."""

    name: str
    unit: Unit
    values: Array


def columns_of(
    path: Path, units: UnitTable, names: Collection[str], given: str | None = None
) -> list[Column]:
    """The columns of a file in any format of recordings, in SI.

    Parameters
    ----------
    names : names by which the row of titles is found.
    given : titles that replace those of the file, separated by commas. An empty title leaves a
        column out; a repeated title begins a block of columns with points of its own.

    Raises `CurveRefused`, or what reading a recording raises.
    """
    form = FileForm(time=(*names, *(name.lower() for name in names)))
    with opened_table(path, form) as sheet:
        titles, beside = list(sheet.titles), list(sheet.units)
        bare = all(is_value(t) or t.strip() == "1" for t in titles if t.strip())
        read = sheet.read((), tuple(range(len(titles))), INFERRED).columns
        numbers = [column.numbers() for column in read]
    if bare:
        if given is None:
            hint = "say what they are, as in --columns 'Q [m3/h], H [m]'"
            raise CurveRefused(f"{path}: its columns have no titles; {hint}")
        first = [_number(title) for title in titles]
        numbers = [np.append(one, rest) for one, rest in zip(first, numbers, strict=True)]
    if given is not None:
        titles, beside = [part.strip() for part in given.split(",")], []
        if len(titles) != len(numbers):
            asked = f"--columns names {len(titles)} columns, and the file has {len(numbers)}"
            raise CurveRefused(f"{path}: {asked}; an empty name leaves one out")
    if not len(numbers[0]) or len(numbers[0]) > MOST_SHEET_POINTS:
        raise CurveRefused(
            f"{path}: {len(numbers[0])} points; a sheet has 1 to {MOST_SHEET_POINTS}. A recording "
            "of a plant is for rulec calibrate"
        )
    named = [_name_and_unit(t, beside[i] if beside else "") for i, t in enumerate(titles)]
    return list(_stacked(path, named, numbers, units))


def _stacked(
    path: Path, named: Sequence[tuple[str, str]], numbers: Sequence[Array], units: UnitTable
) -> Iterator[Column]:
    """Columns, with blocks of the same name stacked."""
    blocks: list[dict[str, tuple[str, Array]]] = [{}]
    for (name, text), values in zip(named, numbers, strict=True):
        if name in blocks[-1]:
            blocks.append({})
        if name:
            blocks[-1][name] = text, values
    for name in dict.fromkeys(name for block in blocks for name in block):
        texts = {block[name][0] for block in blocks if name in block}
        if len(texts) > 1:
            raise CurveRefused(f"{path}: column '{one_line(name)[:40]}' has two units")
        unit = _unit(path, name, texts.pop(), units)
        parts = [
            block[name][1] if name in block else np.full(len(next(iter(block.values()))[1]), np.nan)
            for block in blocks
            if block
        ]
        values = np.concatenate(parts)
        finite = np.where(np.isfinite(values), values, np.nan)
        yield Column(name=name, unit=unit, values=finite * unit.factor + unit.offset)


def _name_and_unit(title: str, beside: str) -> tuple[str, str]:
    name, unit = parts_of(title.strip())
    inside = _IN_BRACKETS.fullmatch(name)
    if not unit and inside is not None:
        name, unit = inside["name"], inside["unit"]
    return name.strip(), unit.strip() or beside.strip()


def unit_of(text: str, units: UnitTable) -> Unit | None:
    """A unit as sheets spell it; None if unknown."""
    try:
        return units.parse(text.strip().translate(_SUPERSCRIPTS))
    except ValueError:
        return None


def _unit(path: Path, name: str, text: str, units: UnitTable) -> Unit:
    shown = one_line(name)[:40]
    if not text:
        hint = f"write it behind the name, as in '{shown} [m3/h]', or use --columns"
        raise CurveRefused(f"{path}: column '{shown}' names no unit; {hint}")
    unit = unit_of(text, units)
    if unit is None:
        raise CurveRefused(
            f"{path}: column '{shown}': unknown unit '{one_line(text)[:40]}'; "
            "the spellings are in kb/units.yaml"
        )
    return unit


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return np.nan


_FILE = Path(__file__).with_name("words.yaml")

_GIVES = {
    "flow": (Dimension.of({"m": 3, "s": -1}),),
    "head": (Dimension.of({"m": 1}), Dimension.of({"kg": 1, "m": -1, "s": -2})),
    "power": (Dimension.of({"kg": 1, "m": 2, "s": -3}), Dimension.of({"kg": 1, "m": 2, "s": -2})),
}
"""Dimensions by the word of a grade: head may also be a pressure, power a torque."""


@dataclass(frozen=True)
class Grade:
    """A tolerance: shares by word (see `_GIVES`), or one `share` of everything."""

    name: str
    shares: Mapping[str, float]
    source: str

    def of(self, dimension: Dimension) -> Accuracy | None:
        """The tolerance of a quantity; None if the grade does not cover it."""
        for word, share in self.shares.items():
            if not _GIVES.get(word) or any(dimension.fits(d) for d in _GIVES[word]):
                return Accuracy(share, self.source)
        return None


def grade_of(text: str) -> Grade:
    """A grade by its name, or by a share and its source, as in ``10 %, IEC 60534-2-4``.

    Raises `CurveRefused`.
    """
    grades: Mapping[str, Any] = _words()["grades"]
    if text in grades:
        entry = dict(grades[text])
        source = str(entry.pop("source"))
        return Grade(text, {word: share / 100.0 for word, share in entry.items()}, source)
    share, percent, source = text.partition("%")
    try:
        value = float(share) / 100.0
    except ValueError:
        value = -1.0
    if not (percent and 0.0 < value < 1.0 and source.strip(" ,")):
        raise CurveRefused(
            f"--grade '{text[:40]}': give {', '.join(grades)}, or a share with its source, "
            "as in '10 %, IEC 60534-2-4'"
        )
    return Grade(f"{100 * value:g} %", {"": value}, source.strip(" ,"))


def role_of(name: str) -> str:
    """The role of a column by its name, where its unit cannot tell; else empty.

    >>> role_of("Eta"), role_of("Q")
    ('efficiency', '')
    """
    return next((role for role, names in _words()["roles"].items() if name.lower() in names), "")


@functools.cache
def _words() -> Any:
    return yaml.safe_load(_FILE.read_text(encoding="utf-8"))
