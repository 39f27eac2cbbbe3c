"""Characteristics given as points: each becomes a definition and two parameters of its module type.

A table is another way to write an equation: straight lines between its points, and on beyond the
first and the last. So everything that reads definitions reads tables: plan, derivatives,
simulation, faults, effects. At a point the derivative is the mean of those on both sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from rulec.language.diagnostics import Diagnostic
from rulec.language.document import Document, Path_

GROUP = "tables"
SIZE, PER = "size", "per"
"""Endings of the parameters of a table: one unit of what it gives, and of what it stands over."""

DIGITS = 8
"""Significant digits of coefficients: a data sheet has three."""


def with_tables(document: Document, found: list[Diagnostic]) -> Document:
    """A module type with its tables written out; other documents stay as they are.

    Reports a table whose name is taken (KB034) or whose points do not go up (KB123).
    """
    data = document.data
    tables: Mapping[str, Any] = data.get(GROUP, {}) if "module" in data else {}
    if not tables:
        return document
    places, keys = dict(document.values), dict(document.keys)
    groups: dict[str, dict[str, Any]] = {
        group: dict(data.get(group, {})) for group in ("parameters", "definitions")
    }
    for name, table in tables.items():
        _check(document, name, table, found)
        own: list[Path_] = [("definitions", name)]
        groups["definitions"][name] = {"is": equation(name, table), **_title(table)}
        for ending, entry in (
            (SIZE, {"unit": table["unit"], "u": table["u"], "title": f"size of the curve {name}"}),
            (PER, {"unit": table["in"], "u": 0, "fit": False, "title": f"unit of {table['over']}"}),
        ):
            own.append(("parameters", f"{name}_{ending}"))
            entry = {"value": 1, **entry, "source": table["source"]}
            groups["parameters"][f"{name}_{ending}"] = entry
        for path in own:
            places[path], keys[path] = document.place(GROUP, name), document.key(GROUP, name)
        places["definitions", name, "is"] = document.place(GROUP, name, "over")
        places["parameters", f"{name}_{SIZE}", "unit"] = document.place(GROUP, name, "unit")
        places["parameters", f"{name}_{PER}", "unit"] = document.place(GROUP, name, "in")
    return replace(document, data={**data, **groups}, values=places, keys=keys)


def equation(name: str, table: Mapping[str, Any]) -> str:
    """The curve as an equation.

    >>> equation("Kv", {"over": "x", "points": [[0, 1], [50, 2], [100, 5]]})
    'Kv_size*(1 + 0.02*(x/Kv_per - 0) + 0.04*max(x/Kv_per - 50, 0))'
    """
    points: Sequence[Sequence[float]] = table["points"]
    at = f"{table['over']}/{name}_{PER}"
    slopes = [(d - b) / (c - a) if c != a else 0.0 for (a, b), (c, d) in pairwise(points)]
    terms = [_number(points[0][1]), f"{_number(slopes[0])}*({at} - {_number(points[0][0])})"]
    for (x, _), (before, after) in zip(points[1:], pairwise(slopes), strict=False):
        if after != before:
            terms.append(f"{_number(after - before)}*max({at} - {_number(x)}, 0)")
    return f"{name}_{SIZE}*({' + '.join(terms)})"


def _check(
    document: Document, name: str, table: Mapping[str, Any], found: list[Diagnostic]
) -> None:
    for group in ("signals", "states", "parameters", "definitions"):
        for used in (name, f"{name}_{SIZE}", f"{name}_{PER}"):
            if used in document.data.get(group, {}):
                message, second = f"the name '{used}' means two things", document.key(group, used)
                place = document.key(GROUP, name)
                hint = f"rename one: a table brings '{name}_{SIZE}' and '{name}_{PER}' along"
                found.append(Diagnostic(place, "KB034", message, hint, second))
    for i, ((x, _), (following, _)) in enumerate(pairwise(table["points"]), 1):
        if not x < following:
            message = f"{following:g} stands behind {x:g}: the points of a table go up"
            place = document.place(GROUP, name, "points", i)
            found.append(Diagnostic(place, "KB123", message, "sort them, and give each once"))


def _title(table: Mapping[str, Any]) -> dict[str, str]:
    return {"title": table["title"]} if "title" in table else {}


def _number(value: float) -> str:
    """A number as it stands in an equation, a negative one in brackets."""
    text = f"{value:.{DIGITS}g}"
    return f"({text})" if value < 0 else text
