"""Which variable of which module is what, as a table: for whoever wires controllers and central
part."""

from __future__ import annotations

from collections.abc import Iterable

from rulec_runtime.output.csv_cell import row_of

from rulec.export.program import ModuleCode

HEADER = ("module", "routine", "direction", "name", "type", "unit", "id", "meaning")


def wiring_csv(codes: Iterable[ModuleCode]) -> str:
    """One row per variable; `id` is its column in the results file, or the signal that it reads."""
    rows = [row_of(HEADER)]
    for code in codes:
        for routine in code.routines:
            for way, variables in (("in", routine.inputs), ("out", routine.outputs)):
                for v in variables:
                    kind = {"real": "LREAL", "bool": "BOOL"}[v.kind]
                    place = (code.module, routine.name, way, v.name, kind)
                    rows.append(row_of([*place, v.unit, v.id, v.text]))
    return "\n".join(rows) + "\n"
