"""Read JSON that somebody may have edited or sent."""

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rulec_runtime import limits
from rulec_runtime.output.open_file import bytes_of

DIGEST = "digest"
"""Key of the digest of everything else in a file."""


class Damaged(ValueError):
    """The file is not JSON as this tool writes it; the message says what is wrong."""


def read_json(path: Path) -> Any:
    """Content of a JSON file; raises `Damaged`, or OSError if it cannot be opened."""
    try:
        return parse_json(bytes_of(path, limits.LARGEST_JSON).decode("utf-8"))
    except UnicodeDecodeError:
        raise Damaged("it is not UTF-8") from None


def parse_json(text: str) -> Any:
    """Content of a JSON text; raises `Damaged` for numbers that are not finite, or deep nesting."""
    try:
        return json.loads(text, parse_int=_whole, parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise Damaged("it is nested too deep") from None
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise Damaged(f"it is not JSON: {error.msg} at {where}") from None


def _whole(text: str) -> int:
    if len(text) > limits.MOST_DIGITS:
        raise Damaged(f"it holds a number of {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise Damaged(f"it holds {text[:30]}, which is no number")
    return number


def digest_of(data: Any, default: Callable[[Any], Any] | None = None) -> str:
    """SHA-256 of JSON data in canonical form: sorted keys, no blanks, ASCII.

    The entry `DIGEST` is omitted, so that a file can hold its own digest.

    >>> digest_of({"a": 1, "b": [2.0]}) == digest_of({"b": [2.0], "digest": "x", "a": 1})
    True
    """
    plain = {k: v for k, v in data.items() if k != DIGEST}
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"), default=default)
    return hashlib.sha256(text.encode()).hexdigest()
