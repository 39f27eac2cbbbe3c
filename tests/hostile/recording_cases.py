"""Hostile recordings."""

from __future__ import annotations

import gzip
from collections.abc import Iterator

from tests.hostile.case import Case
from tests.hostile.texts import FORMULAS, MARKUP, STEERING
from tests.runtime.sheets import Sheet, example

SHEET = Sheet(example().header, example().rows[:12])
DIAGNOSE = ("diagnose", "{rules}", "r.csv", "--json", "out.json")
SIMULATE = ("simulate", "{rules}", "r.csv", "-o", "out.csv")


def titled(title: str) -> str:
    """A recording with one more column."""
    header = ",".join(SHEET.header) + ',"' + title.replace('"', '""') + '"'
    return "\n".join([header, *(",".join(row) + ",1" for row in SHEET.rows)]) + "\n"


def celled(cell: str, column: str = "A.dp") -> str:
    """A recording with one odd cell in each third row."""
    quoted = '"' + cell.replace('"', '""') + '"'
    return SHEET.mapped(column, lambda k, c: quoted if k % 3 == 1 else c).text()


def diagnosed(family: str, name: str, text: str | bytes) -> Case:
    return Case(family, name, DIAGNOSE, {"r.csv": text})


def cases() -> Iterator[Case]:
    for name, text in STEERING.items():
        yield diagnosed("headers", f"{name} in a title", titled(f"{text} [1]"))
        yield diagnosed(
            "headers", f"{name} in a unit", SHEET.renamed("A.dp", f"A.dp [{text}]").text()
        )
        yield diagnosed("cells", name, celled(text))
    for i, text in enumerate(MARKUP):
        yield diagnosed("headers", f"markup {i} in a title", titled(text))
        yield diagnosed("cells", f"markup {i}", celled(text))
        yield Case("file names", f"markup {i} as a recording", (DIAGNOSE[0], "{rules}", text))
    for i, text in enumerate(FORMULAS):
        yield Case("formulas", f"{i} in a title", SIMULATE, {"r.csv": titled(text)})
        yield Case("formulas", f"{i} in a cell", SIMULATE, {"r.csv": celled(text)})
        yield Case("formulas", f"{i} as a time", SIMULATE, {"r.csv": celled(text, "time")})
    yield from _odd_headers()
    yield from _times()
    yield from _sizes()
    yield from _packed()


def _odd_headers() -> Iterator[Case]:
    titles = {
        "2500 blanks": "x" + " " * 2500 + "y [z] w",
        "100000 blanks": "A.dp" + " " * 100_000 + "[bar",
        "tabs and blanks": "a" + " \t" * 20_000 + "b]",
        "brackets": "[" * 20_000,
        "closing brackets": "]" * 20_000,
        "pairs of brackets": "[]" * 20_000,
        "a million letters": "x" * 1_000_000,
        "a unit of 100000 letters": "A.dp2 [" + "bar*" * 25_000 + "bar]",
        "a deep unit": "A.n [" + "(" * 500 + "rpm" + ")" * 500 + "]",
        "a power of a unit": "A.n [rpm**999999999]",
        "a code as unit": "A.n [__import__('os')]",
        "lines": "a\nb\n\nc",
        "empty": "",
        "lone quote": 'a"b',
    }
    for name, title in titles.items():
        yield diagnosed("headers", name, titled(title))
    yield diagnosed("headers", "20000 columns", "time [s]" + ",x" * 20_000 + "\n0" + ",1" * 20_000)
    yield diagnosed("headers", "no end of line", "time [s],A.dp [bar]" * 50_000)
    yield diagnosed("headers", "UTF-16", SHEET.text().encode("utf-16"))
    yield diagnosed("headers", "half of UTF-16", SHEET.text().encode("utf-16")[:-1])
    yield diagnosed("headers", "unclosed quote", '"' + SHEET.text())


def _times() -> Iterator[Case]:
    times = {
        "year 1 with a zone": "0001-01-01T00:00:{k:02}+05:00",
        "year 1 with the other zone": "0001-01-01T00:00:{k:02}-05:00",
        "year 9999 with a zone": "9999-12-31T23:59:{k:02}-05:00",
        "year 9999": "9999-12-31T23:59:{k:02}",
        "day 99": "99.99.2024 00:00:{k:02}",
        "1e300": "{k}e300",
        "1e-300": "{k}e-300",
        "negative": "-{k}",
        "infinite": "inf",
        "1e14": "1000000000000{k:02}",
        "hexadecimal": "0x{k}",
        "digits of another script": "\u0661{k}",
        "underscores": "1_{k}",
        "a zone of 23:59": "2024-01-01T00:00:{k:02}+23:59",
        "half a date": "2024-01",
    }
    for name, form in times.items():
        yield diagnosed(
            "times", name, SHEET.mapped("time", lambda k, _, f=form: f.format(k=k)).text()
        )


def _sizes() -> Iterator[Case]:
    for column in ("A.n", "A.dp", "A.P_el", "B.n", "C.dp"):
        for factor in ("1e4", "1e7", "1e10", "1e13", "1e100", "-1e13"):
            cells = [repr(float(row[SHEET.index(column)]) * float(factor)) for row in SHEET.rows]
            text = SHEET.mapped(column, lambda k, _, cells=cells: cells[k]).text()
            yield diagnosed("readings", f"{column} times {factor}", text)
    for name, cell in {
        "largest double": "1.7976931348623157e308",
        "smallest double": "5e-324",
        "400 digits": "9" * 400,
        "a million digits": "1" * 1_000_000,
        "not a number": "nan",
        "hexadecimal": "0x1p3",
    }.items():
        yield diagnosed("readings", name, celled(cell))


def _packed() -> Iterator[Case]:
    text = SHEET.text().encode()
    packed = gzip.compress(text)
    for name, raw in {
        "bomb of rows": gzip.compress(text + b"0," * 70_000_000, 9),
        "twice packed": gzip.compress(packed),
        "cut short": packed[:-9],
        "wrong sum": packed[:-8] + b"\0" * 8,
        "rubbish behind": packed + b"rubbish",
        "nothing in it": gzip.compress(b""),
        "two in one": packed + packed,
        "head alone": packed[:10],
    }.items():
        yield diagnosed("packed", name, raw)
