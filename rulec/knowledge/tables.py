"""Characteristics given as points: each becomes a definition and two parameters of its module type.

A table is another way to write an equation: straight lines or a monotone cubic between its points,
and straight lines beyond the first and the last. So whatever reads definitions also reads tables:
plan, derivatives, simulation, faults, effects, code for controllers. The derivative at a point is
the mean of those on both sides.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from rulec.language.diagnostics import Diagnostic
from rulec.language.read_yaml import Document, Path_

GROUP = "tables"
SIZE, PER = "size", "per"
"""Endings of the parameters of a table: one unit of its value, and one of its argument."""

CUBIC = "monotone-cubic"
"""Value of `between`: no corner at the points, and always between the two neighbouring points."""

DIGITS = 8
"""Significant digits of coefficients; a data sheet has three."""


def with_tables(document: Document, found: list[Diagnostic]) -> Document:
    """A module type with its tables written out; other documents are returned unchanged.

    Reports a table whose name is taken (KB034) or whose points do not rise (KB123).
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
        written = equations(name, table)
        own: list[Path_] = [("definitions", part) for part in written]
        for part, text in written.items():
            own_keys = {key: table[key] for key in ("title", "accuracy") if key in table}
            rest = own_keys if part == name else {"title": f"a part of the curve {name}"}
            groups["definitions"][part] = {"is": text, **rest}
            places["definitions", part, "is"] = document.place(GROUP, name, "over")
        for ending, entry in (
            (SIZE, {"unit": table["unit"], "u": table["u"], "title": f"size of the curve {name}"}),
            (PER, {"unit": table["in"], "u": 0, "fit": False, "title": f"unit of {table['over']}"}),
        ):
            own.append(("parameters", f"{name}_{ending}"))
            entry = {"value": 1, **entry, "source": table["source"]}
            groups["parameters"][f"{name}_{ending}"] = entry
        for path in own:
            places[path], keys[path] = document.place(GROUP, name), document.key(GROUP, name)
        places["parameters", f"{name}_{SIZE}", "unit"] = document.place(GROUP, name, "unit")
        places["parameters", f"{name}_{PER}", "unit"] = document.place(GROUP, name, "in")
    return replace(document, data={**data, **groups}, values=places, keys=keys)


def equations(name: str, table: Mapping[str, Any]) -> dict[str, str]:
    """The curve as definitions; the last has its name.

    >>> equations("Kv", {"over": "x", "points": [[0, 1], [50, 2], [100, 5]]})
    {'Kv': 'Kv_size*(1 + 0.02*(x/Kv_per - 0) + 0.04*max(x/Kv_per - 50, 0))'}
    """
    points: Sequence[Sequence[float]] = table["points"]
    at = f"{table['over']}/{name}_{PER}"
    if table.get("between") == CUBIC and all(a[0] < b[0] for a, b in pairwise(points)):
        parts = {f"{name}_{i}": text for i, text in enumerate(_cubics(at, points), start=1)}
        return {**parts, name: f"{name}_{SIZE}*({' + '.join([_number(points[0][1]), *parts])})"}
    slopes = [(d - b) / (c - a) if c != a else 0.0 for (a, b), (c, d) in pairwise(points)]
    terms = [_number(points[0][1]), f"{_number(slopes[0])}*({at} - {_number(points[0][0])})"]
    for (x, _), (before, after) in zip(points[1:], pairwise(slopes), strict=False):
        if after != before:
            terms.append(f"{_number(after - before)}*max({at} - {_number(x)}, 0)")
    return {name: f"{name}_{SIZE}*({' + '.join(terms)})"}


def _cubics(at: str, points: Sequence[Sequence[float]]) -> Iterator[str]:
    """Rise of a monotone cubic from each point to the next, up to `at`.

    Before the first point and after the last, it continues with the slope there.

    Source: Fritsch and Carlson 1980; slopes by Fritsch and Butland 1984.
    """
    from scipy.interpolate import PchipInterpolator  # slow to load, and few types need it

    curve = PchipInterpolator(*zip(*points, strict=True))
    last = len(points) - 2
    for i, ((x, _), (following, _)) in enumerate(pairwise(points)):
        cube, square, slope = (float(c) for c in curve.c[:3, i])
        way = f"min(max({at} - {_number(x)}, 0), {_number(following - x)})"
        terms = [f"{way}*({_number(slope)} + {way}*({_number(square)} + {way}*{_number(cube)}))"]
        if i == 0 and slope:
            terms.append(f"{_number(slope)}*min({at} - {_number(x)}, 0)")
        behind = float(curve(following, 1))
        if i == last and behind:
            terms.append(f"{_number(behind)}*max({at} - {_number(following)}, 0)")
        yield " + ".join(terms)


def _check(
    document: Document, name: str, table: Mapping[str, Any], found: list[Diagnostic]
) -> None:
    brought = {f"{name}_{SIZE}", f"{name}_{PER}", *equations(name, table)} - {name}
    for group in ("signals", "states", "parameters", "definitions", GROUP):
        taken = document.data.get(group, {})
        for used in (*(() if group == GROUP else (name,)), *sorted(brought)):
            if used in taken:
                message, second = f"the name '{used}' means two things", document.key(group, used)
                place = document.key(GROUP, name)
                hint = f"rename one: a table brings '{name}_{SIZE}' and '{name}_{PER}' along"
                if table.get("between") == CUBIC:
                    hint += f", a cubic one '{name}_1' and so on, too"
                found.append(Diagnostic(place, "KB034", message, hint, second))
    for i, ((x, _), (following, _)) in enumerate(pairwise(table["points"]), 1):
        if not x < following:
            message = f"{following:g} stands behind {x:g}: the points of a table go up"
            place = document.place(GROUP, name, "points", i)
            found.append(Diagnostic(place, "KB123", message, "sort them, and give each once"))


def _number(value: float) -> str:
    """A number as written in an equation, in brackets if negative."""
    text = f"{value:.{DIGITS}g}"
    return f"({text})" if value < 0 else text
