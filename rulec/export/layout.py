"""Lines and numbers of printed code."""

import textwrap

WIDTH = 99

PLAIN_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "ge": ">=", "gt": ">", "le": "<="}
LEVELS = {"and": 1, "ge": 2, "gt": 2, "le": 2, "add": 3, "sub": 3, "mul": 4, "div": 4}
"""Signs of operations, and their precedence."""


def literal(value: float) -> str:
    """A number with all its digits, as C99 and IEC 61131-3 write it.

    >>> literal(0.1), literal(1e-05), literal(-3.0), literal(2.5e22)
    ('0.1', '1.0E-05', '-3.0', '2.5E+22')
    """
    digits, mark, exponent = repr(float(value)).partition("e")
    if "." not in digits:
        digits += ".0"
    return f"{digits}E{exponent}" if mark else digits


def wrapped(line: str, width: int) -> list[str]:
    """A line of a comment, wrapped with a hanging indent."""
    indent = " " * (len(line) - len(line.lstrip()))
    lines = textwrap.wrap(line, width, subsequent_indent=f"{indent}  ", break_on_hyphens=False)
    return lines or [""]


def broken(line: str, indent: str) -> list[str]:
    """A statement, wrapped at blanks."""
    return textwrap.wrap(
        line,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
