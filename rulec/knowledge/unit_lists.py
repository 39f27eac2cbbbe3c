"""Units and quantities of all layers as one table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rulec.language.diagnostics import Diagnostic
from rulec.language.document import Document
from rulec.language.units import UnitTable, unit_table


def table_of(lists: Iterable[Document], found: list[Diagnostic]) -> UnitTable:
    """One table of several lists; a spelling in two of them must mean the same (KB030)."""
    merged: dict[str, dict[str, Any]] = {"units": {}, "quantities": {}}
    first: dict[tuple[str, str], Document] = {}
    for document in lists:
        for group, entries in merged.items():
            for name, part in document.data.get(group, {}).items():
                known = entries.setdefault(name, part)
                other = first.setdefault((group, name), document)
                if _meaning(known) != _meaning(part):
                    what = "unit" if group == "units" else "quantity"
                    message = f"the {what} '{name}' is described in two files, and not alike"
                    place, second = document.key(group, name), other.key(group, name)
                    found.append(Diagnostic(place, "KB030", message, "rename one", second))
    return unit_table(merged)


def _meaning(part: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in part.items() if key != "note"}
