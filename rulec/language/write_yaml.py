"""How numbers, sums and sentences are written, and plain data as YAML in the style of kb/."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

WIDTH = 90
"""Lists longer than this get a line for each entry."""

_PLAIN = re.compile(r"[A-Za-z(]([A-Za-z0-9_ ().*/+\-=<>%;]*[A-Za-z0-9_).%])?")
_WORDS = {"null", "true", "false", "yes", "no", "on", "off"}


def flow(value: Any) -> str:
    """A value on one line.

    >>> flow({"value": 0.02, "unit": "1/K", "u": 0, "source": "own: fitted"})
    '{value: 0.02, unit: "1/K", u: 0, source: "own: fitted"}'
    """
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(flow(part) for part in value) + "]"
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    return repr(value)


def _text(text: str) -> str:
    """Unquoted where YAML reads the text as it is, else in quotes."""
    if _PLAIN.fullmatch(text) and text.lower() not in _WORDS:
        return text
    return json.dumps(text, ensure_ascii=False)


def lines(data: Mapping[str, Any], depth: int = 1) -> Iterator[str]:
    """Lines of a mapping: `depth` levels of mappings in block style, deeper ones in flow style."""
    for key, value in data.items():
        if isinstance(value, Mapping) and depth > 0 and value:
            yield f"{key}:"
            if depth == 1:
                yield from _aligned(value)
            else:
                yield from (f"  {line}" for line in lines(value, depth - 1))
        elif isinstance(value, list) and len(flow(value)) > WIDTH:
            yield f"{key}:"
            yield from (f"  - {flow(part)}" for part in value)
        else:
            yield f"{key}: {flow(value)}"


def _aligned(entries: Mapping[str, Any]) -> Iterator[str]:
    width = max(len(key) for key in entries) + 1
    for key, value in entries.items():
        yield f"  {key + ':':<{width}} {flow(value)}"


def rounded(value: float, digits: int) -> float:
    """Round to significant digits, fewer than a solver's, so that files agree on every machine."""
    return float(f"{value:.{digits}g}")


def signed_sum(terms: Iterable[tuple[float, str]]) -> str:
    """A signed sum of (sign, name) as text; ``0`` if it has no terms.

    >>> signed_sum([(1, "A"), (-1, "B")])
    'A - B'
    """
    text = " ".join(f"{'+' if sign > 0 else '-'} {name}" for sign, name in terms)
    return text.removeprefix("+ ") or "0"


def filled(text: str, slots: Mapping[str, str]) -> str:
    """A sentence with slots such as ``{module}`` filled; unknown slots stay."""
    for slot, value in slots.items():
        text = text.replace(f"{{{slot}}}", value)
    return text
