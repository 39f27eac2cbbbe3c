"""Read and check the file of a fleet, and compile its plants, each ruleset once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import ColumnMap, Ruleset
from rulec_runtime.fleet.plant_day import hash_of
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.open_file import check_address, is_below, is_near
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings.reading_unit import fitting, parse_unit
from rulec_runtime.recordings.titles import parts_of

from rulec.knowledge.layers import PLANT, leads_out
from rulec.knowledge.read import read_alone
from rulec.knowledge.sources import table_of
from rulec.language.diagnostics import Refused
from rulec.language.reader import Reader

RulesetOf = Callable[[Path], Ruleset]

LOCAL = "file://"


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """The content of a fleet file.

    Attributes
    ----------
    recordings : folder, or address of one elsewhere, as ``s3://bucket/recordings``.
    plant_key, day_key : names of the partitions, as in ``plant=P1/day=2026-01-01/``.
    results : folder of results.
    rulesets : text of each ruleset by its hash.
    judged_by : the plant folder or ruleset file of each ruleset, by its hash.
    titles : whether the fleet names columns.
    plants : hash of the ruleset of each named plant; others have the `default`.
    only_named : whether plants that are not named are left out.
    first, last : days, ISO 8601; empty without a limit.
    trace : whether every sample is judged.
    """

    name: str
    title: str
    recordings: str
    plant_key: str
    day_key: str
    results: Path
    rulesets: Mapping[str, str]
    judged_by: Mapping[str, str]
    titles: bool
    plants: Mapping[str, str]
    default: str
    only_named: bool
    first: str
    last: str
    trace: bool


def read_fleet(path: Path, ruleset_of: RulesetOf, results: Path | None = None) -> Fleet:
    """Read a fleet; raises `Refused` with every mistake in the file.

    `ruleset_of` gives the ruleset of a plant folder or ruleset file; `results` replaces the folder
    of results that the file names.
    """
    document, units = read_alone(path, "fleet")
    reader = Reader(document, table_of(units, []), [])
    data, base = document.data, path.parent
    named = data.get("plants", {})
    files = {name: part["judged_by"] for name, part in named.items() if part}
    places: dict[str, tuple[str, ...]] = {name: ("plants", name, "judged_by") for name in files}
    if "judged_by" in data:
        files[""], places[""] = data["judged_by"], ("judged_by",)
    for name in named:
        if name not in files and "" not in files:
            message = f"nothing says which plant or ruleset judges '{name}'"
            hint = "give it a 'judged_by', or the whole fleet one"
            reader.report_key(("plants", name), "KB150", message, hint)
    if not named and "" not in files:
        message = "nothing says which plant or ruleset judges the fleet"
        reader.report_key(("fleet",), "KB150", message, "add 'judged_by'")
    first, last = _days(reader, data.get("days", {}))
    recordings = _recordings(reader, base)
    if results is None:
        results = (base / data.get("results", f"{data['fleet']}.results")).resolve()
        if not is_below(results, base):
            message = f"results would be written to '{results}', which is not below this file"
            reader.report(("results",), "KB016", message, "name the folder with --results")
    if reader.found:
        raise Refused(reader.found)
    made: dict[str, str] = {}
    texts: dict[str, str] = {}
    for name, file in files.items():
        if file not in made:
            made[file] = _ruleset(reader, places[name], base, ruleset_of)
            texts[hash_of(made[file])] = made[file]
    if reader.found:
        raise Refused(reader.found)
    default = hash_of(made[files[""]]) if "" in files else ""
    partitions = data.get("partitions", {})
    return Fleet(
        name=data["fleet"],
        title=data.get("title", data["fleet"]),
        recordings=recordings,
        plant_key=partitions.get("plant", "plant"),
        day_key=partitions.get("day", "day"),
        results=results,
        rulesets=texts,
        judged_by={hash_of(text): str((base / file).resolve()) for file, text in made.items()},
        titles=bool(data.get("titles")),
        plants={name: hash_of(made[files[name]]) if name in files else default for name in named},
        default=default,
        only_named=bool(named),
        first=first,
        last=last,
        trace=bool(data.get("trace", False)),
    )


def _recordings(reader: Reader, base: Path) -> str:
    """The place of the recordings: a folder near the file, or an address elsewhere."""
    place: str = reader.document.data["recordings"]
    if "://" in place:
        try:
            check_address(place)
        except Refusal as refusal:
            reader.report(("recordings",), "KB016", str(refusal))
        if not place.startswith(LOCAL):
            return place
    folder = (base / place.removeprefix(LOCAL)).resolve()
    if not is_near(folder, base):
        reader.found.append(leads_out(reader.document.place("recordings"), place))
    return str(folder)


def _days(reader: Reader, part: Mapping[str, Any]) -> tuple[str, str]:
    for key, text in part.items():
        try:
            # Days are compared as texts, and Python reads 20260131 as well.
            is_day = date.fromisoformat(text).isoformat() == text
        except ValueError:
            is_day = False
        if not is_day:
            message = f"there is no day '{text}'"
            reader.report(("days", key), "KB151", message, "write it as 2026-01-31")
    first, last = part.get("from", ""), part.get("to", "")
    if first and last and first > last and not reader.found:
        message = f"'from' {first} is behind 'to' {last}"
        reader.report(("days", "from"), "KB151", message)
    return first, last


def _ruleset(reader: Reader, path: tuple[str, ...], base: Path, ruleset_of: RulesetOf) -> str:
    """Text of the ruleset of a plant, with the column names of the fleet; empty, with a report, if
    there is no such plant."""
    file = base / reader.part(path)
    if not (file / PLANT).is_file() and not is_near(file, base):
        reader.found.append(leads_out(reader.document.place(*path), reader.part(path)))
        return ""
    if not file.exists():
        message = f"there is no plant or ruleset '{reader.part(path)}'"
        reader.report(path, "KB001", message, "paths are seen from the fleet file")
        return ""
    ruleset = ruleset_of(file)
    columns, time = _columns(reader, ruleset)
    if not columns and not time:
        return ruleset.to_json()
    taken = {one.column for one in columns}
    kept = tuple(one for one in ruleset.columns if one.column not in taken)
    changed = replace(ruleset, columns=(*kept, *columns), time_column=time or ruleset.time_column)
    return changed.to_json()


def _columns(reader: Reader, ruleset: Ruleset) -> tuple[list[ColumnMap], str]:
    """The column map of the fleet's files, and the title of the time column."""
    found, time = [], ""
    for title, meant in reader.document.data.get("titles", {}).items():
        path = ("titles", title)
        name, text = parts_of(meant)
        if name == "time":
            time = title
            continue
        signal = ruleset.signal_by_id.get(name)
        if signal is None:
            hint = did_you_mean(name, ruleset.signal_by_id)
            reader.report(path, "KB085", f"'{ruleset.plant}' has no signal '{name}'", hint)
            continue
        unit, own = (parse_unit(u, ruleset.units) for u in (text or signal.unit, signal.unit))
        if unit is None or own is None or unit.dimension != own.dimension:
            known = ", ".join(fitting(own, ruleset.units)[:8]) or signal.unit
            reader.report(path, "KB086", f"'{text}' is no unit of {name}", f"known: {known}")
            continue
        found.append(ColumnMap(name, title, unit.factor, unit.offset))
    return found, time
