"""All code of a plant: two routines for each module that estimates a flow, and their wiring."""

import json
from collections.abc import Iterable
from dataclasses import replace

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.json_file import DIGEST

from rulec.export.identifiers import Identifiers
from rulec.export.program import ModuleCode
from rulec.export.routines import Observe, undo_routine
from rulec.export.value_names import listed_undo


def code_of(ruleset: Ruleset) -> tuple[ModuleCode, ...]:
    """Code of each module that estimates its flow, in the plant's order."""
    digest = json.loads(ruleset.to_json())[DIGEST]
    ruleset = replace(ruleset, undo=listed_undo(ruleset))
    names = Identifiers(frozenset())  # suffixes keep them from being reserved words
    found = []
    for module in ruleset.modules:
        if any(o.module == module for o in ruleset.observers):
            routines = (Observe(ruleset, module).routine(), undo_routine(ruleset, module))
            head = _head(ruleset, module, digest)
            found.append(ModuleCode(module, names.new(module), head, routines))
    return tuple(found)


def _head(ruleset: Ruleset, module: str, digest: str) -> tuple[str, ...]:
    """The head of the files of a module; the same ruleset gives the same lines."""
    own = [o for o in ruleset.observers if o.module == module]
    files = dict.fromkeys(o.origin.partition(":")[0] for o in own)
    return (
        f"Module {module} ({ruleset.modules[module]}) of plant {ruleset.plant}",
        f"Type: {', '.join(files)}",
        f"Ruleset: format {ruleset.format_version}, sha256 {digest}",
        f"Sources: {ruleset.sources}",
        *(f"Knowledge: {k.name} {k.version} {k.digest}" for k in ruleset.knowledge),
        "Written by rulec export; change the sources, not this file.",
        "Inputs are in the units named beside them, outputs in SI (flows in m3/s).",
        "",
        "Estimates and their sources:",
        *(f"  {o.equation}   ({o.origin})" for o in own),
    )


def wiring_csv(codes: Iterable[ModuleCode]) -> str:
    """A row per variable, for those who wire controllers and central part; `id` is its column in
    the results file, or the signal that it reads."""
    header = ("module", "routine", "direction", "name", "type", "unit", "id", "meaning")
    rows = [row_of(header)]
    for code in codes:
        for routine in code.routines:
            for way, variables in (("in", routine.inputs), ("out", routine.outputs)):
                for v in variables:
                    kind = {"real": "LREAL", "bool": "BOOL"}[v.kind]
                    place = (code.module, routine.name, way, v.name, kind)
                    rows.append(row_of([*place, v.unit, v.id, v.text]))
    return "\n".join(rows) + "\n"
