"""From a table as it is written to one with a column per signal and one time: what is long, in
pairs, or beside columns of qualities is put in order, by its column map or by its titles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rulec_runtime.contract.file_form import AS_SEEN, FileForm
from rulec_runtime.recordings.held import held
from rulec_runtime.recordings.long_table import long_sheet
from rulec_runtime.recordings.pairs import pair_sheet
from rulec_runtime.recordings.places import Places, places_of
from rulec_runtime.recordings.quality import codes_told, judged
from rulec_runtime.recordings.table import Sheet, Table, lines_of, texts_of
from rulec_runtime.recordings.time_column import time_of_parts


def arrange(path: Path, sheet: Sheet, form: FileForm) -> Sheet:
    """A table with a column per signal. Raises `RecordingRefused` where it is not written as its
    column map says."""
    places = places_of(path, sheet.titles, form)
    if places.layout == "long":
        return long_sheet(path, sheet, places, form)
    if places.layout == "pairs":
        return pair_sheet(path, sheet, places.pairs, form)
    if len(places.time) < 2 and not places.quality_of and form.hold != "last":
        return sheet
    return _wide(path, sheet, places, form)


def _wide(path: Path, sheet: Sheet, places: Places, form: FileForm) -> Sheet:
    """A table without its columns of qualities, whose time is one column."""
    aside = {*places.time[1:], *(places.quality_of or {}).values()}
    there = [i for i in range(len(sheet.titles)) if i not in aside]
    titles = [sheet.titles[i] for i in there]
    if len(form.time) > 1:
        titles[there.index(places.time[0])] = form.time_title
    table = _WideTable(path, sheet, places, tuple(there), form)
    return replace(
        sheet,
        titles=tuple(titles),
        units=tuple(sheet.units[i] for i in there),
        read=table.read,
        lines=lambda: lines_of(table.read, len(there)),
    )


@dataclass(frozen=True)
class _WideTable:
    """Columns that are `there`, of a table that has others besides."""

    path: Path
    sheet: Sheet
    places: Places
    there: tuple[int, ...]
    form: FileForm

    def read(self, kept: Sequence[int], numbers: Sequence[int], _: FileForm = AS_SEEN) -> Table:
        form = self.form
        wanted = [self.there[i] for i in numbers]
        judges = {i: q for i, q in (self.places.quality_of or {}).items() if i in wanted}
        parts = self.places.time if len(self.places.time) > 1 or form.hold == "last" else ()
        asked = [*(self.there[i] for i in kept), *parts, *judges.values()]
        table = self.sheet.read(asked, wanted, form)
        cells, beside = table.kept[: len(kept)], table.kept[len(kept) :]
        columns = dict(zip(wanted, table.columns, strict=True))
        qualities = [texts_of(cells) for cells in beside[len(parts) :]]
        found = set().union(*qualities)
        remarks = table.remarks
        if found:
            title = self.sheet.titles[next(iter(judges.values()))]
            remarks = (*remarks, *codes_told(self.path, title, found, form))
        for (index, quality), texts in zip(judges.items(), qualities, strict=True):
            title = self.sheet.titles[quality]
            columns[index] = judged(self.path, columns[index], title, texts, found, form)
        time = None
        if parts:
            time, remarks = time_of_parts(self.path, beside[: len(parts)], form, remarks)
            places = [i for i, k in enumerate(kept) if self.there[k] == parts[0]]
            cells = tuple(time if i in places else cell for i, cell in enumerate(cells))
        if form.hold == "last" and time is not None:
            columns, remarks = held(columns, time, form, remarks)
        return replace(
            table, kept=cells, columns=tuple(columns[i] for i in wanted), remarks=remarks
        )
