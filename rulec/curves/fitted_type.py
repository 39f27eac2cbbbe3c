"""A fitted law as a module type: the file of the old type with the sheet's values in it."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np

from rulec.curves.fit import Compared, FittedCurve
from rulec.curves.limits import SHEET_SCATTER
from rulec.effects.write_module import file_text, plain_number
from rulec.knowledge.module_type import Accuracy
from rulec.language.document import Document


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
    by_points = Accuracy(
        plain_number(max(compared.usual, 2.0 * SHEET_SCATTER), 2),
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
