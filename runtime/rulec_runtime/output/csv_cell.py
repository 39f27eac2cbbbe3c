"""Cells of written CSV files: a spreadsheet must not run what somebody put into a name.

A cell that begins like a formula gets an apostrophe before it, as spreadsheets do themselves.
Numbers stay numbers. Source: OWASP, CSV Injection.
"""

from __future__ import annotations

from collections.abc import Iterable

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_MARK = "'"


def defused(cell: str) -> str:
    """A cell as it is written.

    >>> [defused(cell) for cell in ("=1+1", "-1.5", "-1,5", "-", "@x", "A.dp")]
    ["'=1+1", '-1.5', '-1,5', '-', "'@x", 'A.dp']
    """
    if not cell.startswith(_FORMULA) or cell == "-" or _is_number(cell):
        return cell
    return _MARK + cell


def as_meant(cell: str) -> str:
    """A cell as it was before it was written; so what this tool wrote, it reads.

    >>> as_meant("'=x"), as_meant("'x"), as_meant(defused("@speed"))
    ('=x', "'x", '@speed')
    """
    return cell[1:] if cell.startswith(_MARK) and cell[1:].startswith(_FORMULA) else cell


def row_of(cells: Iterable[str]) -> str:
    """Names as one row of a file with commas; quoted where they hold one.

    >>> print(row_of(["time [s]", "=x", "a,b"]))
    time [s],'=x,"a,b"
    """
    return ",".join(_quoted(defused(cell)) for cell in cells)


def _quoted(cell: str) -> str:
    if any(sign in cell for sign in ',"\r\n'):
        return '"' + cell.replace('"', '""') + '"'
    return cell


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
