"""Cells of written CSV files: a spreadsheet must not run a formula that somebody put into a name.

A cell that begins like a formula gets a leading apostrophe, as in spreadsheets. Numbers stay
numbers. Source: OWASP, CSV Injection.
"""

from collections.abc import Iterable

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def defused(cell: str) -> str:
    """The text that is written for a cell.

    >>> [defused(cell) for cell in ("=1+1", "-1.5", "-1,5", "-", "@x", "A.dp")]
    ["'=1+1", '-1.5', '-1,5', '-', "'@x", 'A.dp']
    """
    if not cell.startswith(_FORMULA) or cell == "-":
        return cell
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return "'" + cell
    return cell


def as_meant(cell: str) -> str:
    """The inverse of `defused`, so that this tool reads what it wrote.

    >>> as_meant("'=x"), as_meant("'x"), as_meant(defused("@speed"))
    ('=x', "'x", '@speed')
    """
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(_FORMULA) else cell


def row_of(cells: Iterable[str]) -> str:
    """Names as one comma-separated row, quoted where necessary.

    >>> print(row_of(["time [s]", "=x", "a,b"]))
    time [s],'=x,"a,b"
    """
    return ",".join(_quoted(defused(cell)) for cell in cells)


def _quoted(cell: str) -> str:
    if any(sign in cell for sign in ',"\r\n'):
        return '"' + cell.replace('"', '""') + '"'
    return cell
