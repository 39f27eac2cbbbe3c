"""A fitted law or a learnt curve as a module type: the file of the old type with new values."""

import copy
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rulec.curves.fit import Compared, FittedCurve
from rulec.curves.learn import Learnt
from rulec.curves.limits import MOST_ACCURACY, SHEET_SCATTER
from rulec.effects.write_module import file_text, plain_number
from rulec.knowledge.module_type import Accuracy, ModuleType
from rulec.language.read_yaml import Document
from rulec.language.units import Dimension, Unit, UnitTable


def module_of(document: Document, fitted: FittedCurve, name: str, source: str) -> str:
    """Text of the file. `document` is as its author wrote it, with tables as tables.

    The sheet fixes the shape of a curve; the grade says how far a pump of the series may deviate.
    So each law gets a size factor near 1, which is all that calibration changes.
    """
    data: dict[str, Any] = copy.deepcopy(dict(document.data))
    data["module"] = name
    data["title"] = f"{data['title']}; {source}"
    kind = fitted.kind
    for parameter, value in fitted.parameters.items():
        entry, own = data["parameters"].get(parameter), kind.parameters[parameter]
        if entry is None or parameter in fitted.untold:
            continue
        entry |= {
            # Seven digits, so that rounding does not show in differences of large terms.
            "value": plain_number(own.unit.from_si(value), 7),
            "u": 0,
            "fit": False,
            "source": source,
        }
    for compared in fitted.laws:
        _sized(data, compared, source)
    for reading, middle in _middle(fitted).items():
        signal, entry = kind.signals[reading], data["signals"][reading]
        entry["reference"] = plain_number(signal.unit.from_si(middle), 4)
        if signal.minimum and signal.reference:
            # The same share of a usual reading as in the type.
            least = signal.minimum * middle / signal.reference
            entry["minimum"] = plain_number(signal.unit.from_si(least), 3)
    for reading, values in fitted.points.readings.items():
        if "range" in data["signals"].get(reading, {}):
            _widen(data["signals"][reading], kind.signals[reading].unit.from_si(np.nanmax(values)))
    comments = [f"Law of {kind.name} fitted to a maker's points by rulec import curve: {source}."]
    return file_text(Path(document.path), data, comments)


def _sized(data: dict[str, Any], compared: Compared, source: str) -> None:
    """Multiply a law by a size factor, and state the accuracy of its form."""
    law, key = compared.law, "is" if compared.law.group == "definitions" else "Q"
    size = f"{law.name}_size"
    entry = data[law.group][law.name]
    entry[key] = f"{size}*({entry[key]})"
    entry["accuracy"] = form_of(compared).text
    tolerance = compared.tolerance
    data["parameters"][size] = {
        "value": 1,
        "unit": "1",
        "u": plain_number(compared.u, 3),
        "title": f"{law.name} of this one over the sheet's",
        "source": f"{tolerance.text}; points scatter by {100 * compared.scatter:.2g} %: {source}",
    }


def form_of(compared: Compared) -> Accuracy:
    """The accuracy of a law's form, apart from its size: by the points if all that the law reads
    varies there, else the accuracy that the type states, if that is larger."""
    share = min(max(compared.usual, 2.0 * SHEET_SCATTER), MOST_ACCURACY)
    by_points = Accuracy(
        plain_number(share, 2),
        f"19 of 20 of {compared.points} points of the sheet",
    )
    stated = compared.stated
    return by_points if compared.varied or by_points.share > stated.share else stated


def _middle(fitted: FittedCurve) -> dict[str, float]:
    """Readings at the middle point of the sheet, SI."""
    readings = {n: v for n, v in fitted.points.readings.items() if n in fitted.kind.signals}
    whole = np.flatnonzero(np.all([np.isfinite(v) for v in readings.values()], axis=0))
    middle = whole[len(whole) // 2] if len(whole) else None
    return {} if middle is None else {name: float(v[middle]) for name, v in readings.items()}


def _widen(entry: dict[str, Any], largest: float) -> None:
    """Where the sheet exceeds a sensor's range, its full scale becomes 1, 2 or 5 times 10^n."""
    low, high = entry["range"]
    if largest > high:
        power = 10.0 ** math.floor(math.log10(largest))
        top = next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= largest)
        entry["range"] = [low, plain_number(top, 3)]


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
    accuracy = 100.0 * min(max(learnt.accuracy, 1e-3), MOST_ACCURACY)
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
