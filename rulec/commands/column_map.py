"""A column map for a recording, proposed from its content."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime import limits as limits_of_runtime
from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.ruleset import ColumnMap, Ruleset, SignalSpec
from rulec_runtime.recordings.column_roles import ColumnRoles, roles_of
from rulec_runtime.recordings.csv_table import RecordingRefused, Unclear
from rulec_runtime.recordings.formats import opened_sheet, opened_table
from rulec_runtime.recordings.quality import standard_of
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.recording_file import RecordingFile, files_of, form_of, read_file
from rulec_runtime.recordings.table import Dates, Sheet, texts_of
from rulec_runtime.recordings.text_table import conventions
from rulec_runtime.recordings.time_column import COUNTINGS, SPREADSHEET, TimeReader
from rulec_runtime.recordings.titles import parts_of

from rulec import limits
from rulec.language.write_yaml import flow

_WORD = re.compile(r"[A-Za-z]+|\d+")


@dataclass(frozen=True)
class Proposal:
    """Text of a column map. `assumed` are likely choices, `asked` questions that only a person can
    answer, both in words."""

    text: str
    assumed: tuple[str, ...]
    asked: tuple[str, ...]


def proposed(path: Path, ruleset: Ruleset, stated: Mapping[str, Any]) -> Proposal:
    """A column map for the first file of a recording.

    What the map of the plant already `stated` remains, as far as the file has these columns. Raises
    `RecordingRefused` if it holds no table.
    """
    path = files_of(path)[0]
    form, assumed, asked = form_of(ruleset), list[str](), list[str]()
    unanswered = set[str]()
    for _ in range(limits.MOST_QUESTIONS):
        try:
            found = _found(path, ruleset, form, stated)
            break
        except Unclear as unclear:
            form = replace(form, **unclear.choices[0])
            (assumed if unclear.likely else asked).append(str(unclear))
            if not unclear.likely:
                # A column map has its own name for this field of the form.
                choices = unclear.choices[0]
                unanswered |= {"unit" if key == "time_factor" else key for key in choices}
    else:
        raise RecordingRefused(f"{path}: it can be read in too many ways; {asked[0]}")
    # The map omits open questions, so the file is refused until somebody answers them.
    found = replace(
        found,
        file={key: value for key, value in found.file.items() if key not in unanswered},
        time={key: value for key, value in found.time.items() if key not in unanswered},
    )
    return Proposal(_text(path, ruleset, found, asked), tuple(assumed), tuple(asked))


@dataclass(frozen=True)
class _Found:
    """Content of a file: its form, its time, title and unit per signal, and other titles.

    The file names no unit for the signals in `bare`. `kept` are entries of the map of the plant.
    """

    file: Mapping[str, Any]
    time: Mapping[str, Any]
    columns: Mapping[str, tuple[str, str]]
    bare: frozenset[str]
    others: tuple[str, ...]
    kept: Mapping[str, Any]


def _found(path: Path, ruleset: Ruleset, form: FileForm, stated: Mapping[str, Any]) -> _Found:
    with opened_sheet(path, form) as sheet:
        titles = [title.strip() for title in sheet.titles]
        units = [unit.strip() for unit in sheet.units]
    short = {title: parts_of(title)[0] for title in titles}
    kept = {
        key: part
        for key, part in stated.get("columns", {}).items()
        if {*_columns_of(part)} <= {*titles, *short.values()}
    }
    taken = {name for part in kept.values() for name in _columns_of(part)}
    pairs = zip(titles, units, strict=True)
    free = [(title, unit) for title, unit in pairs if taken.isdisjoint((title, short[title]))]
    columns, bare = dict[str, tuple[str, str]](), set[str]()
    for title, unit in free:
        signal = _signal_of(title, ruleset)
        if signal is None or signal.id in columns.keys() | kept.keys():
            continue
        own = parts_of(title)[1] or unit
        is_unit = own and parse_unit(own, ruleset.units) is not None
        columns[signal.id] = title, own if is_unit else signal.unit
        bare |= set() if own else {signal.id}
    with opened_table(path, form) as table:
        roles = roles_of(path, table.titles, form)
        time = _time(path, table, roles, form, ruleset)
        file = {**_layout(path, table, roles, form), **_numbers(path, table, roles, form)}
    of_time = time.get("from", "")
    several = isinstance(of_time, list)
    mapped = replace(
        ruleset,
        columns=(
            *(column for column in ruleset.columns if column.signal in kept),
            *(
                ColumnMap(name, title, *_conversion(unit, ruleset))
                for name, (title, unit) in columns.items()
            ),
        ),
        time_column=FileForm(time=tuple(of_time)).time_title if several else of_time,
        file=replace(form, time=tuple(of_time)) if several else form,
    )
    missing = sorted(_sentinels(read_file(path, mapped, []), mapped))
    if missing:
        file["missing"] = [int(x) if x == int(x) else x for x in missing]
    used = {title for title, _ in columns.values()} | ({*of_time} if several else {of_time})
    others = tuple(title for title, _ in free if title not in used)
    file = {**stated.get("file", {}), **file}
    return _Found(file, {**time, **kept.get("time", {})}, columns, frozenset(bare), others, kept)


def _columns_of(part: Mapping[str, Any]) -> list[str]:
    """Titles of the columns that an entry of a column map reads."""
    name, minus = part["from"], part.get("minus")
    names = name if isinstance(name, list) else [name]
    return [*names, minus["from"]] if minus else names


def _signal_of(title: str, ruleset: Ruleset) -> SignalSpec | None:
    """The one signal whose name occurs in a title: word for word, in any case."""
    name = parts_of(title)[0]
    if name in ruleset.signal_by_id:
        return ruleset.signal_by_id[name]
    words = _words(name)
    occurring = [s for s in ruleset.signals if _holds(words, _words(s.id))]
    most = max((len(_words(s.id)) for s in occurring), default=0)
    longest = [s for s in occurring if len(_words(s.id)) == most]
    return longest[0] if len(longest) == 1 else None


def _words(text: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(text)]


def _holds(words: Sequence[str], wanted: Sequence[str]) -> bool:
    size = len(wanted)
    return any(list(words[k : k + size]) == list(wanted) for k in range(len(words) - size + 1))


def _conversion(unit: str, ruleset: Ruleset) -> tuple[float, float]:
    found = parse_unit(unit, ruleset.units)
    return (1.0, 0.0) if found is None else (found.factor, found.offset)


def _time(
    path: Path, table: Sheet, roles: ColumnRoles, form: FileForm, ruleset: Ruleset
) -> dict[str, Any]:
    """The entry of a column map for the time."""
    at = roles.time or ((roles.pairs[0].time,) if roles.pairs else ())
    if not at:
        return {}
    titles = [table.titles[i].strip() for i in at]
    found: dict[str, Any] = {"from": titles[0] if len(titles) == 1 else titles}
    cells = table.read([at[0]], (), form).raw[0]
    if isinstance(cells, Dates):
        return found
    unit = parts_of(titles[0])[1] or table.units[at[0]].strip()
    factor = _conversion(unit, ruleset)[0] if unit else 0.0
    times = TimeReader(path, form, [], titles[0], lambda: factor)
    times.read(cells)
    counting = times.counting
    if counting in (*COUNTINGS, SPREADSHEET) and counting.unit not in ruleset.units:
        return found  # not a unit of a plant, and the file is clear without it
    if counting is not None:
        return found | {"unit": counting.unit, "since": counting.since}
    if times.dated is False:
        return found | {"unit": unit or "s"}
    return found | ({"dates": times.order} if times.order else {})


def _layout(path: Path, table: Sheet, roles: ColumnRoles, form: FileForm) -> dict[str, Any]:
    """The entries of a column map for columns that are neither time nor signal."""
    found: dict[str, Any] = {}
    beside = [*(roles.quality_of or {}).values(), *(p.quality for p in roles.pairs)]
    qualities = [i for i in dict.fromkeys((roles.quality, *beside)) if i >= 0]
    usual = [t.strip() for t in table.titles] == ["tag", "time", "value"]
    if roles.layout == "long" and not usual:
        found = {"layout": "long", "tag": table.titles[roles.tag].strip()}
        found["value"] = table.titles[roles.value].strip()
    elif roles.layout == "pairs":
        found = {"layout": "pairs"}
    if roles.quality >= 0:
        found["quality"] = table.titles[roles.quality].strip()
    if qualities:
        texts = set().union(*map(texts_of, table.read(qualities, ()).raw))
        standard = form.good or standard_of(path, table.titles[qualities[0]], texts)
        good = (standard,) if isinstance(standard, str) and standard else tuple(standard)
        found |= {"good": _shown(good)} if good else {}
    return found | ({"hold": form.hold} if form.hold else {})


def _shown(good: Sequence[str]) -> str | list[Any]:
    named = len(good) == 1 and good[0].startswith("opc ")
    return good[0] if named else [int(x) if x.isdigit() else x for x in good]


def _numbers(path: Path, table: Sheet, roles: ColumnRoles, form: FileForm) -> dict[str, str]:
    """The signs in numbers that another program might read differently."""
    aside = {*roles.time, roles.tag, roles.quality, roles.unit}
    at = (
        [roles.value]
        if roles.layout == "long"
        else [i for i in range(len(table.titles)) if i not in aside]
    )
    sample = list(islice(table.lines(), limits_of_runtime.SHOWING_ROWS))
    found = conventions(path, table.titles, sample, at, table.separator, form)
    marks = "".join(sorted({mark for one in found for mark in one.thousands}))
    decimal = {one.decimal for one in found if one.decimal}
    if marks:
        return {"decimal": next(iter(decimal), "."), "thousands": marks}
    return {"decimal": ","} if decimal == {","} else {}


def _sentinels(read: RecordingFile, ruleset: Ruleset) -> Iterator[float]:
    """Numbers that recur, farther outside a sensor's range than the range is wide."""
    for target in read.header.targets:
        signal = ruleset.signal_by_id[target.signal]
        low, high = signal.ends
        values = read.values[target.signal]
        values = values[np.isfinite(values)]
        far = values[(values < 2 * low - high) | (values > 2 * high - low)]
        for value, count in Counter(far.tolist()).items():
            if count >= limits.SENTINEL:
                yield round((value - target.offset) / target.factor, 6)


def _text(path: Path, ruleset: Ruleset, found: _Found, asked: Sequence[str]) -> str:
    lines = [f"# Proposed by rulec check from {path.name}: look at each line before you use it."]
    lines += [f"# To be answered first: {one.partition(': ')[2]}" for one in asked]
    if found.file:
        lines.append(f"file: {flow(found.file)}")
    lines.append("columns:")
    entries = {"time": flow(found.time)} if found.time else {}
    notes = {}
    for signal in ruleset.signals:
        if signal.id in found.kept:
            entries[signal.id] = flow(found.kept[signal.id])
        elif signal.id in found.columns:
            title, unit = found.columns[signal.id]
            entries[signal.id] = flow({"from": title, "unit": unit})
            if signal.id in found.bare:
                notes[signal.id] = "  # the file names no unit"
    width = max(map(len, entries), default=0) + 1
    lines += [f"  {f'{n}:':<{width}} {e}{notes.get(n, '')}" for n, e in entries.items()]
    there = entries.keys()
    lacking = [s for s in ruleset.signals if s.id not in there and s.id in ruleset.read]
    lines += [f"  # {s.id}: {{from: ..., unit: {flow(s.unit)}}}" for s in lacking]
    lines += [f"# no signal: {title}" for title in found.others]
    return "\n".join(lines) + "\n"
