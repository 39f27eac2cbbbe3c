"""Hostile recordings."""

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
        unit = SHEET.renamed("A.dp", f"A.dp [{text}]").text()
        yield diagnosed("headers", f"{name} in a title", titled(f"{text} [1]"))
        yield diagnosed("headers", f"{name} in a unit", unit)
        yield diagnosed("cells", name, celled(text))
    for i, text in enumerate(MARKUP):
        yield diagnosed("headers", f"markup {i} in a title", titled(text))
        yield diagnosed("cells", f"markup {i}", celled(text))
    for i, text in enumerate(FORMULAS):
        yield Case("formulas", f"{i} in a title", SIMULATE, {"r.csv": titled(text)})
        yield Case("formulas", f"{i} in a cell", SIMULATE, {"r.csv": celled(text)})
        yield Case("formulas", f"{i} as a time", SIMULATE, {"r.csv": celled(text, "time")})
    for i, title in enumerate(TITLES):
        yield diagnosed("headers", f"title {i}", titled(title))
    for i, whole in enumerate(HEADERS):
        yield diagnosed("headers", f"{i}", whole)
    for form in TIMES:
        times = SHEET.mapped("time", lambda k, _, f=form: f.format(k=k))
        yield diagnosed("times", form, times.text())
    for column in ("A.n", "A.dp", "A.P_el", "C.dp"):
        for factor in ("1e7", "1e13", "1e100", "-1e13"):
            text = SHEET.mapped(column, lambda _, c, f=factor: repr(float(c) * float(f))).text()
            yield diagnosed("readings", f"{column} times {factor}", text)
    for i, cell in enumerate(CELLS):
        yield diagnosed("readings", f"cell {i}", celled(cell))
    for i, raw in enumerate(PACKED):
        yield diagnosed("packed", f"{i}", raw)


TITLES = [
    "x" + " " * 2500 + "y [z] w", "A.dp" + " " * 100_000 + "[bar", "a" + " \t" * 20_000 + "b]",
    "[" * 20_000, "[]" * 20_000, "x" * 1_000_000, "A.dp2 [" + "bar*" * 25_000 + "bar]",
    "A.n [" + "(" * 500 + "rpm" + ")" * 500 + "]", "A.n [rpm**999999999]", "A.n [__import__('os')]",
    "a\nb\n\nc", "", 'a"b',
]  # fmt: skip
HEADERS: list[str | bytes] = [
    "time [s]" + ",x" * 20_000 + "\n0" + ",1" * 20_000, "time [s],A.dp [bar]" * 50_000,
    SHEET.text().encode("utf-16"), SHEET.text().encode("utf-16")[:-1], '"' + SHEET.text(),
]  # fmt: skip
TIMES = [
    "0001-01-01T00:00:{k:02}+05:00", "9999-12-31T23:59:{k:02}-05:00", "99.99.2024 00:00:{k:02}",
    "{k}e300", "{k}e-300", "-{k}", "inf", "1000000000000{k:02}", "0x{k}", "\u0661{k}", "1_{k}",
    "2024-01-01T00:00:{k:02}+23:59", "2024-01",
]  # fmt: skip
CELLS = ["1.7976931348623157e308", "5e-324", "9" * 400, "1" * 1_000_000, "nan", "0x1p3"]
TEXT = SHEET.text().encode()
GZIP = gzip.compress(TEXT)
PACKED = [
    gzip.compress(TEXT + b"0," * 70_000_000, 9), gzip.compress(GZIP), GZIP[:-9],
    GZIP[:-8] + b"\0" * 8, GZIP + b"rubbish", gzip.compress(b""), GZIP + GZIP, GZIP[:10],
]  # fmt: skip
"""A bomb, packed twice, cut, a wrong sum, rubbish behind, nothing, two in one, a head alone."""
