"""A learnt curve as a module type: the type of the module with a table for the definition."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rulec.curves.learn import Learnt
from rulec.effects.write_module import file_text, plain_number
from rulec.knowledge.module_type import ModuleType
from rulec.language.document import Document
from rulec.language.units import Dimension, Unit, UnitTable


def dropped(kind: ModuleType, definition: str) -> list[str]:
    """Parameters that nothing uses once the definition is a table."""
    kept = [e for path, e in kind.equations_at() if path[1] != definition]
    used = {name for part in kept for name, _ in part.names()}
    own = {name for name, _ in kind.definitions[definition].expression.names()}
    return [name for name in kind.parameters if name in own - used]


def table_units(
    learnt: Learnt, dimensions: Mapping[str, Dimension], units: UnitTable
) -> tuple[Unit, Unit]:
    """Units of driver and definition: those of signals or parameters of the type if they fit."""
    kind = learnt.module.type

    def unit_of(name: str) -> Unit:
        if name in kind.signals:
            return units.difference(kind.signals[name].unit)
        own = [p.unit for p in kind.parameters.values()] + [s.unit for s in kind.signals.values()]
        alike = [unit for unit in own if unit.dimension.fits(dimensions[name])]
        return next((u for u in alike if not u.offset), units.plain(dimensions[name]))

    return unit_of(learnt.over), unit_of(learnt.name)


def type_of(
    document: Document, learnt: Learnt, units: tuple[Unit, Unit], name: str, source: str
) -> str:
    """Text of the new type's file; `document` is the old type as its author wrote it."""
    data: dict[str, Any] = copy.deepcopy(dict(document.data))
    data["module"] = name
    kind, definition = learnt.module.type, learnt.name
    old = data.get("definitions", {}).pop(definition, None) or data["tables"].pop(definition)
    for parameter in dropped(kind, definition):
        data["parameters"].pop(parameter, None)
    share = float(np.median(learnt.u / np.abs(learnt.values)))
    accuracy = min(max(100.0 * learnt.accuracy, 0.1), 50.0)  # no type may state more than 50 %
    over, unit = units
    data.setdefault("tables", {})[definition] = {
        "over": learnt.over,
        "in": over.text,
        "unit": unit.text,
        "points": [
            [plain_number(x / over.factor, 5), plain_number(y / unit.factor, 5)]
            for x, y in zip(learnt.knots.tolist(), learnt.values.tolist(), strict=True)
        ],
        "u": plain_number(max(share, 1e-3), 3),
        "accuracy": f"{plain_number(accuracy, 2):g} %, 19 of 20 of {learnt.points} points",
        **({"title": old["title"]} if "title" in old else {}),
        "source": source,
    }
    ordered = {key: data[key] for key in (*_ORDER, *data) if data.get(key)}
    band = ", ".join(f"{u / unit.factor:.2g}" for u in learnt.u.tolist())
    comments = [
        f"{definition} of {kind.name} learnt by rulec calibrate --learn: {source}.",
        f"Standard uncertainties at its points: {band} {unit.text}; 'u' is their median share.",
    ]
    comments += [
        f"No data from {_shown(low, over)} to {_shown(high, over)}: a straight line there."
        for low, high in learnt.gaps
    ]
    return file_text(Path(document.path), ordered, comments)


_ORDER = (
    "module", "version", "title", "signals", "provides", "states", "parameters", "tables",
    "definitions", "readings", "observers", "residuals", "faults",
)  # fmt: skip


def _shown(value: float, unit: Unit) -> str:
    return f"{value / unit.factor:.3g} {unit.text}" if math.isfinite(value) else "?"
