"""Unit codes of Module Type Packages beside a list that others publish.

``python -m tests.rig.unit_codes IODD-StandardUnitDefinitions1.1.xml`` prints every code of ours
whose meaning differs there, or which is not there, and exits 1 if there is any. That file numbers
units as the PROFIBUS PA profile does; the Python package iodd-parser holds it.
"""

from __future__ import annotations

import sys
import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path

from rulec.mtp.tables import tables

_PLAIN = str.maketrans({"·": "*", "µ": "u", "L": "l", "Ω": "Ohm"})
_OTHERWISE = {"°C": "degC", "°F": "degF", "°R": "degR", "°": "deg", "r": "rev", "dm3": "l"}
"""Spellings of that list for units of ours; each part of a quotient is looked up."""
_TOGETHER = {"N*m": "Nm", "kN*m": "kNm", "MW*h": "MWh"}


def published(file: Path) -> dict[str, str]:
    """Unit by code, as the file abbreviates it."""
    units = (e for e in ET.parse(file).iter() if e.tag.rpartition("}")[2] == "Unit")
    return {unit.attrib["code"]: unit.attrib["abbr"] for unit in units}


def plain(unit: str) -> str:
    """A published unit in our spelling.

    >>> plain("kg/dm³"), plain("N·m"), plain("m/s²"), plain("°C")
    ('kg/l', 'Nm', 'm/s**2', 'degC')
    """
    power = "m/s**2" if unit == "m/s²" else ""
    text = power or unicodedata.normalize("NFKC", unit).replace("μ", "µ").translate(_PLAIN)
    return _TOGETHER.get(text, "/".join(_OTHERWISE.get(part, part) for part in text.split("/")))


def differences(codes: Mapping[str, str], other: Mapping[str, str]) -> Iterator[str]:
    """A line for each code that means something else there, or nothing."""
    for code, unit in codes.items():
        if code not in other:
            yield f"{code} {unit}: not published"
        elif plain(other[code]) != unit:
            yield f"{code} {unit}: published as {other[code]}"


def main(arguments: list[str]) -> int:
    codes = tables().codes
    found = list(differences(codes, published(Path(arguments[0]))))
    print(*found, f"{len(codes) - len(found)} of {len(codes)} codes agree", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
