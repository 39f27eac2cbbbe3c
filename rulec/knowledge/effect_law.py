"""Read the law of an effect: an equation that may use the plain law at another point.

``law(dp=0)`` is the plain law with a driver replaced. Equations have no other keyword arguments;
each distinct one is replaced by a name of its own before the equation is parsed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from rulec.knowledge.effect import PLAIN, EffectLaw
from rulec.language.expression import Expression, Rejected, parse

_ELSEWHERE = re.compile(rf"\b{PLAIN}\s*\(")
_NUMBERED = re.compile(rf"\b{PLAIN}_[0-9]+\b")
_SETTING = re.compile(r"\s*([A-Za-z][A-Za-z0-9_]{0,40})\s*=(.*)", re.DOTALL)
_EXAMPLE = f"as in {PLAIN}(dp=0)"

Columns = dict[tuple[str, str], tuple[int, int]]
"""Columns of a replaced driver and of its replacement, by entry of `substitutes` and driver."""


def parse_law(text: str) -> tuple[EffectLaw, Columns]:
    """Read the law of an effect; raises `Rejected` for anything outside the language.

    The names that replace ``law(...)`` are padded, so that columns match those of the text.

    >>> law, _ = parse_law("law(dp=0) - c*(law(dp=0) - law)")
    >>> law.expression.text
    'law_1     - c*(law_1     - law)'
    >>> law.substitutes["law_1"]["dp"].text
    '0'
    """
    numbered = _NUMBERED.search(text)
    if numbered:
        message = f"'{numbered[0]}' is neither driver nor parameter of this effect"
        raise Rejected("KB036", numbered.start(), message, _EXAMPLE, len(numbered[0]))
    names: dict[str, str] = {}
    substitutes: dict[str, dict[str, Expression]] = {}
    columns: Columns = {}
    plain, done = "", 0
    for start, opening, end in _calls(text):
        key = re.sub(r"\s", "", text[opening + 1 : end])
        if key not in names:
            names[key] = name = f"{PLAIN}_{len(names) + 1}"
            settings = _settings(text, opening + 1, end)
            substitutes[name] = {driver: value for driver, (value, _, _) in settings.items()}
            columns |= {(name, driver): (at, to) for driver, (_, at, to) in settings.items()}
        plain += text[done:start] + names[key].ljust(end + 1 - start)
        done = end + 1
    return EffectLaw(text, parse(plain + text[done:]), substitutes), columns


def _calls(text: str) -> Iterator[tuple[int, int, int]]:
    """Columns of each outermost ``law(...)``: its start, opening and closing bracket."""
    end = -1
    for found in _ELSEWHERE.finditer(text):
        opening = found.end() - 1
        if found.start() < end:
            message = f"{PLAIN}(...) cannot stand inside another"
            raise Rejected("KB045", found.start(), message, _EXAMPLE, found.end() - found.start())
        depth = 0
        for end in range(opening, len(text)):
            depth += (text[end] == "(") - (text[end] == ")")
            if depth == 0:
                break
        if depth:
            raise Rejected("KB040", opening, "this bracket never closes", "is a ) missing?")
        yield found.start(), opening, end


def _settings(text: str, start: int, end: int) -> dict[str, tuple[Expression, int, int]]:
    """Per driver its replacement, with the columns of both."""
    result: dict[str, tuple[Expression, int, int]] = {}
    for at, part in _parts(text, start, end):
        found = _SETTING.fullmatch(part)
        if found is None or found[1] in result:
            message = f"{PLAIN}(...) takes each driver once, with what replaces it"
            raise Rejected("KB045", at, message, _EXAMPLE, max(1, len(part)))
        column = at + found.start(2)
        try:
            value = parse(found[2])
        except Rejected as error:
            error.column += column
            raise
        result[found[1]] = (value, at + found.start(1), column)
    return result


def _parts(text: str, start: int, end: int) -> Iterator[tuple[int, str]]:
    """Parts between the commas outside of brackets, with their columns."""
    depth, first = 0, start
    for i in range(start, end):
        depth += (text[i] == "(") - (text[i] == ")")
        if text[i] == "," and not depth:
            yield first, text[first:i]
            first = i + 1
    yield first, text[first:end]
