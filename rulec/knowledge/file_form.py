"""The format of recordings, from a plant's column map."""

from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from typing import Any

from rulec_runtime.contract.file_form import START, FileForm

from rulec.language.reader import Reader
from rulec.language.units import SECOND

_COPIED = ("layout", "tag", "value", "quality", "hold", "decimal", "thousands")


def file_form(reader: Reader) -> FileForm:
    """The format that a column map states; mistakes of meaning are reported."""
    data: Mapping[str, Any] = reader.document.data
    part, time = data.get("file", {}), data["columns"].get("time", {})
    parts, good = time.get("from", ()), part.get("good", ())
    form = FileForm(
        **{key: part[key] for key in _COPIED if key in part},
        time=() if isinstance(parts, str) else tuple(parts),
        dates=time.get("dates", ""),
        since=_since(reader, time.get("since", "")),
        time_factor=_factor(reader, time),
        good=(good,) if isinstance(good, str) else tuple(str(one) for one in good),
        hold_for=_longest(reader, part),
        missing=tuple(float(number) for number in part.get("missing", ())),
    )
    if form.decimal and form.decimal in form.thousands:
        message = f"'{form.decimal}' cannot be the decimal sign and mark thousands"
        reader.report(("file", "thousands"), "KB152", message, "take out one of them")
    return form


def time_title(time: Mapping[str, Any]) -> str:
    """The title of the time column, or of several that form the time."""
    parts = time["from"]
    return parts if isinstance(parts, str) else FileForm(time=tuple(parts)).time_title


def _factor(reader: Reader, time: Mapping[str, Any]) -> float:
    """Seconds per unit of numeric times; 0 if the unit is not stated, or s without ``since``."""
    if "unit" not in time:
        return 0.0
    unit = reader.unit_of(SECOND, "time", "columns", "time", "unit")
    return 0.0 if unit.factor == 1 and "since" not in time else float(unit.factor)


def _since(reader: Reader, text: str) -> str:
    if text in ("", START):
        return text
    try:
        datetime.fromisoformat(text)
    except ValueError:
        message = f"there is no date '{text[:30]}'"
        hint = "as in 1970-01-01T00:00:00Z, or 1899-12-30"
        reader.report(("columns", "time", "since"), "KB152", message, hint)
    return text


def _longest(reader: Reader, part: Mapping[str, Any]) -> float | None:
    """The longest time that a reading holds, s."""
    if "for" not in part:
        return None
    path, text = ("file", "for"), str(part["for"])
    number, _, name = text.partition(" ")
    with suppress(ValueError):
        unit = reader.units.parse(name or "s")
        if unit.dimension.fits(SECOND):
            return float(number) * float(unit.factor)
    hint = reader.units.like(SECOND)
    reader.report(path, "KB152", f"'{text[:20]}' is no length of time", hint)
    return None
