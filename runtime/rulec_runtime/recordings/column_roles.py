"""Find the roles of the columns of a table, by its column map or by its titles."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.titles import is_time, names_of_times, parts_of

TAGS = ("tag", "tagname", "tag name", "tag_name", "tagindex", "varname", "point", "pointname",
        "variable", "variable name", "name", "node", "nodeid", "series", "metric", "signal",
        "channel", "item", "kanal", "messstelle")  # fmt: skip
VALUES = ("value", "wert", "val", "varvalue", "messwert", "reading")
QUALITIES = ("quality", "qualität", "qc", "status", "statuscode", "status code", "validity",
             "isgood", "is good", "confidence", "dataintegrity", "opcquality")  # fmt: skip
OF_ROWS = ("quality", "qualität", "validity", "isgood", "is good", "opcquality")
"""Alone in a wide table these judge whole rows; a status could be that of the plant."""

OF_TIMES, OF_VALUES = ("time", "timestamp", "zeit"), ("valuey", "value", "wert")
UNITS = ("unit", "units", "einheit", "uom")
DAYS, CLOCKS = ("date", "datum"), ("time", "zeit", "uhrzeit")
PARTS = ("millitm", "millisecond", "milliseconds", "msec", "ms")

_NUMBERED = re.compile(r"(?:time|zeit)[ ._-]?\d+", re.IGNORECASE)
_BETWEEN = " ._/:-()[]"


@dataclass(frozen=True)
class Pair:
    """A column of readings with its title and the columns of its times and its qualities (-1:
    none)."""

    title: str
    value: int
    time: int
    quality: int


@dataclass(frozen=True)
class ColumnRoles:
    """Columns of a table by role; -1 for none.

    `time` are the parts of one time; `quality_of` gives the column of qualities of another column.
    """

    layout: str
    time: tuple[int, ...] = ()
    tag: int = -1
    value: int = -1
    quality: int = -1
    unit: int = -1
    pairs: tuple[Pair, ...] = ()
    quality_of: Mapping[int, int] | None = None


def roles_of(path: Path, titles: Sequence[str], form: FileForm) -> ColumnRoles:
    """Roles of the columns of a table. Raises `RecordingRefused` if a column of the column map is
    missing."""
    plain = [title.strip() for title in titles]
    bare = [parts_of(title)[0] for title in plain]
    times = names_of_times(form)

    def usual(names: Collection[str]) -> int:
        return next((i for i, name in enumerate(bare) if name.lower() in names), -1)

    def stated(title: str, what: str, names: Collection[str] = ()) -> int:
        """The column that the column map names, else one with a usual name."""
        if not title:
            return usual(names)
        found = [i for i in range(len(plain)) if title in (plain[i], bare[i])]
        if not found:
            raise RecordingRefused(
                f"{path}: there is no column '{title[:40]}', which the column map names as {what}"
            )
        return found[0]

    day, clock, part = (usual(names) for names in (DAYS, CLOCKS, PARTS))
    if len(form.time) > 1:
        time = tuple(stated(part, "time") for part in form.time)
    elif form.time and form.time[0] in plain:
        time = (plain.index(form.time[0]),)
    elif min(day, clock) >= 0:
        time = tuple(i for i in (day, clock, part) if i >= 0)
    else:
        time = tuple(i for i, title in enumerate(titles) if is_time(title, times))[:1]
    tag, value = stated(form.tag, "tag", TAGS), stated(form.value, "value", VALUES)
    pairs = _pairs(titles, times, form)
    is_long = bool(time) and min(tag, value) >= 0
    few = len(titles) <= limits.COLUMNS_OF_LONG
    layout = form.layout or ("pairs" if pairs else "long" if is_long and few else "wide")
    if layout == "pairs":
        if not pairs:
            raise RecordingRefused(
                f"{path}: the column map says that columns stand in pairs of time and value, and "
                "the titles do not: each column of readings needs one of times before it"
            )
        return ColumnRoles("pairs", pairs=pairs)
    if layout == "long":
        if not is_long:
            raise RecordingRefused(
                f"{path}: a long table needs a column of tags, one of times and one of values; "
                "name them in the column map, as in 'file: {layout: long, tag: Name, value: Wert}'"
            )
        quality = stated(form.quality, "quality", QUALITIES)
        return ColumnRoles("long", time, tag, value, quality, usual(UNITS))
    return ColumnRoles("wide", time, quality_of=_qualities(titles, times, form))


def _stem(title: str, words: Collection[str]) -> str:
    """The title before one of the words at its end; empty if it ends in none of them.

    >>> _stem("A.n Time", ("time",)), _stem("A.dp [StatusCode]", ("statuscode",)), _stem("Time", ())
    ('A.n', 'A.dp', '')
    """
    text = title.strip().rstrip(_BETWEEN)
    for word in words:
        before = text[: len(text) - len(word)]
        if text[len(before) :].lower() == word and before.rstrip(_BETWEEN) != before:
            return before.rstrip(_BETWEEN)
    return ""


def _pairs(titles: Sequence[str], times: Collection[str], form: FileForm) -> tuple[Pair, ...]:
    """Columns of times, each followed by one of readings and perhaps one of qualities; empty if
    not all titles follow this pattern."""
    timed = [
        i
        for i, title in enumerate(titles)
        if is_time(title, times) or _stem(title, OF_TIMES) or _NUMBERED.fullmatch(title.strip())
    ]
    count = len(titles)
    while count and timed and not titles[count - 1].strip():
        count -= 1
    if len(timed) < 2 or timed[0] != 0:
        return ()
    found = []
    for at, until in zip(timed, [*timed[1:], count], strict=True):
        judged = until - at == 3 and _judges(titles[at + 2], titles[at + 1], form)
        if until - at != 2 and not judged:
            return ()
        quality = at + 2 if judged else -1
        value = titles[at + 1].strip()
        generic = value.lower() in (*VALUES, "valuey")
        title = _stem(titles[at], OF_TIMES) if generic else _stem(value, OF_VALUES)
        found.append(Pair(title or value, at + 1, at, quality))
    return tuple(found)


def _judges(title: str, other: str, form: FileForm) -> bool:
    """Whether a column holds the qualities of another: its title is such a word, perhaps after the
    other's name."""
    words, name = _quality_names(form), other.strip()
    return title.strip().lower() in words or _stem(title, words) in (name, parts_of(name)[0])


def _quality_names(form: FileForm) -> tuple[str, ...]:
    return (*QUALITIES, *((form.quality.lower(),) if form.quality else ()))


def _qualities(titles: Sequence[str], times: Collection[str], form: FileForm) -> dict[int, int]:
    """The column of qualities of each column of readings."""
    words, plain = _quality_names(form), dict[str, int]()
    for i, title in enumerate(titles):
        plain.setdefault(title.strip(), i)
        plain.setdefault(parts_of(title.strip())[0], i)
    stems = [(i, _stem(title, words)) for i, title in enumerate(titles)]
    found = {plain[s]: i for i, s in stems if s and plain.get(s, i) != i and not is_time(s, times)}
    bare = {i - 1: i for i, title in enumerate(titles) if i and title.strip().lower() in words}
    if found or len(bare) > 1:
        return found or bare
    whole = next((i for i in bare.values() if titles[i].strip().lower() in OF_ROWS), None)
    others = (i for i, title in enumerate(titles) if i != whole and not is_time(title, times))
    return {} if whole is None else dict.fromkeys(others, whole)
