"""Units of a package in the spelling of the knowledge base."""

from __future__ import annotations

from dataclasses import dataclass

from rulec.language.units import Unit, UnitTable
from rulec.mtp.package import Attribute
from rulec.mtp.tables import tables


@dataclass(frozen=True, kw_only=True)
class FoundUnit:
    """A unit of a package.

    `raw` is its text in the package, `text` the spelling of the tables (empty if unknown), `unit`
    that of the knowledge base (None if it has none). `is_default`: it is a default of the file;
    `online`: a node holds it.
    """

    raw: str
    text: str
    unit: Unit | None
    is_default: bool
    online: bool


def unit_of(attribute: Attribute | None, units: UnitTable) -> FoundUnit:
    """The unit that an attribute gives by a code or by a text."""
    raw = attribute.known.strip() if attribute is not None else ""
    key = raw[:-2] if raw.endswith(".0") else raw
    text = tables().codes.get(key, "")
    if not text and key and not _is_number(key):
        spelled = tables().spellings.get(key, key)
        text = spelled if _parsed(spelled, units) is not None else ""
    return FoundUnit(
        raw=raw,
        text=text,
        unit=_parsed(text, units) if text else None,
        is_default=attribute is not None and attribute.is_default,
        online=attribute is not None and attribute.node is not None,
    )


def _parsed(text: str, units: UnitTable) -> Unit | None:
    try:
        return units.parse(text)
    except ValueError:
        return None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
