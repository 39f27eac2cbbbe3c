"""What a recording allows the tool to find in a plant, before anything is judged."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.sensor_health import Health, examine
from rulec_runtime.diagnosis.steady.evaluated_points import judgeable
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.formats import opened_sheet
from rulec_runtime.recordings.header import assign
from rulec_runtime.recordings.plant_calendar import duration
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.recording_file import files_of, form_of

from rulec.limits import FAR_READING
from rulec.passes.compile_cache import kept_of_plant, ruleset_of_plant

if TYPE_CHECKING:
    from rulec.effects.candidate import Candidate
    from rulec.effects.match_effects import Matches


Sought = Mapping[str, Any]
"""What a search could look for in a plant, whatever the recording, as JSON data: `effects` that fit
a place, each with the `observers` that it moves and the readings that it `needs`; `unread`
quantities that no sensor of the plant reads, each with the effects driven by it."""


def sought_in(plant: Path) -> Sought:
    """What a search could look for in a plant; cached while nothing changes.

    Raises `Refused` with all mistakes in the plant.
    """

    def sought() -> Sought:
        from rulec.effects.model_builder import open_builder  # loads the compiler

        ruleset, builder = open_builder(plant)
        ruleset_of_plant(plant, lambda: ruleset)
        return sought_of(builder.matches)

    found: Sought = kept_of_plant(plant, "sought", sought)
    return found


def sought_of(matches: Matches) -> Sought:
    """What a search could look for, from all effects that fit some place."""
    unread: dict[str, set[str]] = {}
    for missing in matches.missing:
        unread.setdefault(missing.quantity, set()).add(missing.name)
    return {
        "effects": [
            {"name": c.name, "observers": [*c.observers], "needs": sorted(_needs(c))}
            for c in (m.candidate for m in matches.candidates)
            if c.sort != "fault"
        ],
        "unread": {quantity: sorted(names) for quantity, names in unread.items()},
    }


def _needs(candidate: Candidate) -> set[str]:
    """Readings that drive a candidate."""
    from rulec.knowledge.fluid import reading_of

    drivers = [*candidate.drivers.values(), *(u.driver for u in candidate.unknowns if u.driver)]
    return {reading_of(driver) for driver in drivers if "." in reading_of(driver)}


@dataclass(frozen=True, kw_only=True)
class Reading:
    """A signal and its column; `title` is empty if it has none.

    `low`, `middle`, `high` are its smallest, median and largest reading in its own unit, NaN if it
    has none. `odd` says what is wrong with it, `used` whether some equation reads it.
    """

    signal: str
    title: str
    unit: str
    low: float
    middle: float
    high: float
    odd: tuple[str, ...]
    used: bool


@dataclass(frozen=True, kw_only=True)
class Lack:
    """A reading that is missing or unusable, and what cannot run without it, by name."""

    signal: str
    why: str
    estimates: tuple[str, ...]
    comparisons: tuple[str, ...]
    effects: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What is known before anything runs.

    `estimates`, `comparisons`, `faults` and `effects` are pairs: how many can run or be found, and
    how many there are. `blind` are faults that leave no trace in this recording. `settled` is the
    share of rows in settled stretches, None if the plant stores and is judged while it moves.
    `unread` is as in `Sought`.
    """

    rows: int
    seconds: float
    readings: tuple[Reading, ...]
    strangers: tuple[str, ...]
    notes: tuple[str, ...]
    estimates: tuple[int, int]
    comparisons: tuple[int, int]
    faults: tuple[int, int]
    blind: tuple[str, ...]
    settled: float | None
    stretches: int
    effects: tuple[int, int]
    lacks: tuple[Lack, ...]
    unread: Mapping[str, Sequence[str]]

    def to_dict(self) -> dict[str, Any]:
        """All facts as JSON data; missing readings are null."""
        data = asdict(self)
        for part in data["readings"]:
            for key in ("low", "middle", "high"):
                part[key] = part[key] if math.isfinite(part[key]) else None
        return data

    def tell(self, out: Console, name: str) -> None:
        """Print the columns, what can run, how much is settled, and what a mismatch could find."""
        rows = plural(self.rows, "row", "rows")
        out.print(styled("{}: {} over {}", name, rows, duration(self.seconds)))
        out.print(_columns(self.readings))
        for line in _lines(self):
            out.print(line)


def facts_of(path: Path, ruleset: Ruleset, sought: Sought) -> Facts:
    """Read a recording and find what it is good for; raises `RecordingRefused`."""
    recording = read_recording(path, ruleset)
    health = examine(recording, ruleset)
    usable = {name for name, v in health.recording.values.items() if np.isfinite(v).any()}
    titles, strangers = _headers(path, ruleset)
    running = {o.id for o in ruleset.observers if set(o.signals) <= usable}
    compared = {r.id for r in ruleset.residuals if {t.observer for t in r.terms} <= running}
    visible = {cell.fault for cell in ruleset.cells if cell.residual in compared}
    balances = False  # whether they can be integrated, and something can be compared with them
    if (dynamics := ruleset.dynamics) is not None and usable.issuperset(dynamics.inputs):
        balances = not usable.isdisjoint(dynamics.outputs)
        visible |= set(dynamics.faults if balances else ())
    faults = [f.id for f in ruleset.faults]
    terms = {t.observer for r in ruleset.residuals if r.id in compared for t in r.terms}
    reached = [e for e in sought["effects"] if balances or terms.intersection(e["observers"])]
    found = [e for e in reached if usable.issuperset(e["needs"])]
    settled, stretches = None, 0
    if dynamics is None:
        parts, _ = judgeable(health.recording, ruleset, "default")
        settled, stretches = float(parts.lengths.sum()) / len(recording), len(parts)
    return Facts(
        rows=len(recording),
        seconds=float(recording.time[-1] - recording.time[0]),
        readings=tuple(
            _reading(
                s,
                recording.values.get(s.id, np.array([])),
                title=titles.get(s.id, ""),
                odd=[f.text for f in health.findings if f.signal == s.id],
                used=s.id in ruleset.read,
            )
            for s in ruleset.signals
        ),
        strangers=strangers,
        notes=recording.notes,
        estimates=(len(running), len(ruleset.observers)),
        comparisons=(len(compared), len(ruleset.residuals)),
        faults=(len(visible), len(faults)),
        blind=tuple(f for f in faults if f not in visible),
        settled=settled,
        stretches=stretches,
        effects=(len(found), len(sought["effects"])),
        lacks=tuple(_lacks(ruleset, usable, health, sought)),
        unread=sought["unread"],
    )


def _lacks(
    ruleset: Ruleset, usable: Collection[str], health: Health, sought: Sought
) -> Iterator[Lack]:
    """Signals that something needs and that have no reading."""
    terms = {r.id: {t.observer for t in r.terms} for r in ruleset.residuals}
    for signal in ruleset.signals:
        if signal.id in usable:
            continue
        estimates = tuple(o.id for o in ruleset.observers if signal.id in o.signals)
        driven = sorted({e["name"] for e in sought["effects"] if signal.id in e["needs"]})
        if signal.id in ruleset.read or driven:
            yield Lack(
                signal=signal.id,
                why=(health.recording.unfit or {}).get(signal.id, "not in the recording"),
                estimates=estimates,
                comparisons=tuple(r for r, used in terms.items() if used.intersection(estimates)),
                effects=tuple(driven),
            )


def _reading(
    signal: SignalSpec, values: Array, *, title: str, odd: list[str], used: bool
) -> Reading:
    """What a column of readings, SI, shape (n,), holds; `odd` is what is known to be wrong."""
    values = values[np.isfinite(values)]
    low, middle, high = (math.nan,) * 3
    if values.size:
        low, middle, high = (signal.shown(float(f(values))) for f in (np.min, np.median, np.max))
        odd = odd or [*_far_off(signal, float(np.median(values)))]
    return Reading(
        signal=signal.id,
        title=title,
        unit=signal.unit,
        low=low,
        middle=middle,
        high=high,
        odd=tuple(odd),
        used=used,
    )


def _far_off(signal: SignalSpec, middle: float) -> Iterator[str]:
    """A doubt about the unit of a reading far from the typical one; none if zero is arbitrary."""
    if signal.offset or not signal.reference or not middle:
        return
    ratio = abs(middle / signal.reference)
    if not 1 / FAR_READING <= ratio <= FAR_READING:
        typical = signal.shown(signal.reference)
        yield (
            f"the middle reading is {ratio:.2g} times the typical {typical:.3g} {signal.unit}: "
            "is the unit of the column right?"
        )


def _headers(path: Path, ruleset: Ruleset) -> tuple[dict[str, str], tuple[str, ...]]:
    """The column title of each signal, and the columns that belong to no signal."""
    titles: dict[str, str] = {}
    strangers: dict[str, None] = {}
    for file in files_of(path):
        with opened_sheet(file, form_of(ruleset)) as sheet:
            names = sheet.titles
            header = assign(file, names, ruleset, [], sheet.units)
        titles |= {target.signal: names[target.index].strip() for target in header.targets}
        strangers |= dict.fromkeys(header.strangers)
    return titles, tuple(strangers)


_WHOLE, _PART = "[green]✓[/] {}: {} of {}", "[yellow]![/] {}: {} of {}"

SHOWN = 4
"""Names shown from a list; the others are counted."""


def _columns(readings: Sequence[Reading]) -> Table:
    table = Table(box=None, pad_edge=False)
    for title in ("", "signal", "column", "lowest", "median", "highest", ""):
        number = title in ("lowest", "median", "highest")
        table.add_column(title, justify="right" if number else "left")
    for one in readings:
        if not one.title and not one.used:
            continue  # nothing reads it
        shown = [f"{v:.4g}" if math.isfinite(v) else "" for v in (one.low, one.middle, one.high)]
        cells = [one.signal, one.title or "-", *shown, _remark(one)]
        mark = "[red]-[/]" if not one.title else "[yellow]![/]" if one.odd else "[green]✓[/]"
        table.add_row(styled(mark), *map(Text, cells))
    return table


def _remark(one: Reading) -> str:
    if not one.title:
        return "not in the recording"
    return "; ".join(one.odd) or one.unit + ("" if one.used else ", read by no equation")


def _lines(facts: Facts) -> Iterator[Text]:
    # If a column is missing, the reader of the recording already names the strangers.
    if facts.strangers and not any(one.used and not one.title for one in facts.readings):
        yield styled("columns that belong to no signal: {}", _some(facts.strangers))
    for note in facts.notes:
        yield styled("[dim]note: {}[/]", note)
    if facts.settled is None:
        yield Text("the plant has storage: it is judged while it moves, not only when settled")
    else:
        stretches = plural(facts.stretches, "stretch", "stretches")
        yield styled("settled: {} % of the rows, in {}", f"{100 * facts.settled:.0f}", stretches)
    for what, (count, every) in (
        ("flow estimates available", facts.estimates),
        ("comparisons between them", facts.comparisons),
        ("detectable faults", facts.faults),
    ):
        template = _WHOLE if count == every else _PART
        yield styled(template, what, count, every)
    if facts.blind:
        yield styled("  undetectable: {}", _some(facts.blind))
    for lack in facts.lacks:
        yield styled("  without {} ({}): {}", lack.signal, lack.why, _without(lack))
    yield styled(
        "this recording could reveal {} of {} known effects (`rulec show effects PLANT`)",
        *facts.effects,
    )
    for quantity, names in facts.unread.items():
        yield styled("  with a sensor for {} also: {}", quantity, _some(names))


def _without(lack: Lack) -> str:
    parts = []
    if lack.estimates:
        parts.append(f"no {_some(lack.estimates)}")
    if lack.comparisons:
        parts.append(plural(len(lack.comparisons), "fewer comparison", "fewer comparisons"))
    if lack.effects:
        parts.append(f"mismatch cannot find {_some(lack.effects)}")
    return "; ".join(parts) or "its balance cannot be followed"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
