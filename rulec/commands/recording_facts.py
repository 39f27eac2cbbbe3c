"""What a recording allows the tool to find in a plant, before anything is judged."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.detectable_faults import visible_of
from rulec_runtime.diagnosis.sensors.conditions import SensorFinding
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.evaluated_points import judgeable
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.formats import opened_sheet
from rulec_runtime.recordings.header import assign
from rulec_runtime.recordings.plant_calendar import duration
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.recording_file import files_of, form_of
from rulec_runtime.report.parts import Table, shown

from rulec.limits import FAR_READING
from rulec.passes.compile_cache import ruleset_of_plant, saved_of_plant

if TYPE_CHECKING:
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

    found: Sought = saved_of_plant(plant, "sought", sought)
    return found


Facts = Mapping[str, Any]
"""What is known of a recording before anything runs, as JSON data.

`rows` and `seconds`. `readings`, one per signal: its column `title` ("" if it has none), the `low`,
`middle` and `high` reading in its `unit` (null if it has none), what is `odd` about it, and whether
some equation `used` it. `strangers` are columns of no signal. `estimates`, `comparisons`, `faults`
and `effects` are pairs: how many can run or be found, and how many there are. `blind` are faults
that leave no trace here. `settled` is the share of rows in `stretches` that are settled, null if
the plant stores and is judged while it moves. `lacks`: a `signal` without a reading, `why`, and
which `estimates`, `comparisons` and `effects` cannot run without it. `unread` is as in `Sought`.
"""


def sought_of(matches: Matches) -> Sought:
    """What a search could look for, from all effects that fit some place."""
    from rulec.knowledge.fluid import reading_of  # loads the compiler

    effects, unread = [], dict[str, set[str]]()
    for candidate in (m.candidate for m in matches.candidates if m.candidate.sort != "fault"):
        unknowns = (u.driver for u in candidate.unknowns if u.driver)
        drivers = {reading_of(driver) for driver in (*candidate.drivers.values(), *unknowns)}
        needs = sorted(driver for driver in drivers if "." in driver)
        observers = [*candidate.observers]
        effects.append({"name": candidate.name, "observers": observers, "needs": needs})
    for missing in matches.missing:
        unread.setdefault(missing.quantity, set()).add(missing.name)
    return {"effects": effects, "unread": {what: sorted(names) for what, names in unread.items()}}


def facts_of(path: Path, ruleset: Ruleset, sought: Sought) -> Facts:
    """Read a recording and find what it is good for; raises `RecordingRefused`."""
    recording = read_recording(path, ruleset)
    health = examine(recording, ruleset)
    usable = {name for name, v in health.recording.values.items() if np.isfinite(v).any()}
    titles, strangers = _headers(path, ruleset)
    running = {o.id for o in ruleset.observers if set(o.signals) <= usable}
    terms = {r.id: {t.observer for t in r.terms} for r in ruleset.residuals}
    compared = {name for name, used in terms.items() if used <= running}
    visible = {cell.fault for cell in ruleset.cells if cell.residual in compared}
    balances = False  # whether they can be integrated, and something can be compared with them
    if (dynamics := ruleset.dynamics) is not None and usable.issuperset(dynamics.inputs):
        balances = not usable.isdisjoint(dynamics.outputs)
        lost = {signal.id for signal in ruleset.signals} - usable
        for part in visible_of(ruleset).parts if balances else ():
            traces = np.diag(part.information(lost)).tolist()
            visible |= {f for f, trace in zip(part.highest, traces, strict=True) if trace > 0.0}
    moved = {observer for name in compared for observer in terms[name]}
    reached = [e for e in sought["effects"] if balances or moved.intersection(e["observers"])]
    found = [e for e in reached if usable.issuperset(e["needs"])]
    settled, stretches = None, 0
    if dynamics is None:
        parts, _ = judgeable(health.recording, ruleset, "default")
        settled, stretches = float(parts.lengths.sum()) / len(recording), len(parts)
    readings = []
    for signal in ruleset.signals:
        values = recording.values.get(signal.id, np.array([]))
        odd = [*_each_once(f for f in health.findings if f.signal == signal.id)]
        reading = _reading(signal, values, titles.get(signal.id, ""), odd)
        readings.append({**reading, "used": signal.id in ruleset.read})
    unfit = health.recording.unfit or {}
    faults = [f.id for f in ruleset.faults]
    return {
        "rows": len(recording),
        "seconds": float(recording.time[-1] - recording.time[0]),
        "readings": readings,
        "strangers": strangers,
        "notes": list(recording.notes),
        "estimates": [len(running), len(ruleset.observers)],
        "comparisons": [len(compared), len(ruleset.residuals)],
        "faults": [len(visible), len(faults)],
        "blind": [f for f in faults if f not in visible],
        "settled": settled,
        "stretches": stretches,
        "effects": [len(found), len(sought["effects"])],
        "lacks": [*_lacks(ruleset, usable, unfit, sought)],
        "unread": sought["unread"],
    }


def _each_once(findings: Iterable[SensorFinding]) -> Iterator[str]:
    """The first finding of each kind, and how often it came again."""
    kinds: dict[str, list[str]] = {}
    for one in findings:
        kinds.setdefault(one.condition.name, []).append(one.text)
    for first, *more in kinds.values():
        again = f"; {plural(len(more), 'time', 'times')} more" if more else ""
        yield first + again


def _lacks(
    ruleset: Ruleset, usable: Collection[str], unfit: Mapping[str, str], sought: Sought
) -> Iterator[dict[str, Any]]:
    """Signals that something needs and that have no reading; `unfit` says why one is unusable."""
    terms = {r.id: {t.observer for t in r.terms} for r in ruleset.residuals}
    for signal in (s.id for s in ruleset.signals if s.id not in usable):
        estimates = [o.id for o in ruleset.observers if signal in o.signals]
        driven = sorted({e["name"] for e in sought["effects"] if signal in e["needs"]})
        if signal in ruleset.read or driven:
            yield {
                "signal": signal,
                "why": unfit.get(signal, "not in the recording"),
                "estimates": estimates,
                "comparisons": [r for r, used in terms.items() if used.intersection(estimates)],
                "effects": driven,
            }


def _reading(signal: SignalSpec, values: Array, title: str, odd: list[str]) -> dict[str, Any]:
    """What a column of readings, SI, shape (n,), holds; `odd` is what is known to be wrong."""
    values = values[np.isfinite(values)]
    low = middle = high = None
    if values.size:
        low, middle, high = (signal.shown(float(f(values))) for f in (np.min, np.median, np.max))
        odd = odd or [*_far_off(signal, float(np.median(values)))]
    ends = {"low": low, "middle": middle, "high": high}
    return {"signal": signal.id, "title": title, "unit": signal.unit, **ends, "odd": odd}


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


def _headers(path: Path, ruleset: Ruleset) -> tuple[dict[str, str], list[str]]:
    """The column title of each signal, and the columns that belong to no signal."""
    titles: dict[str, str] = {}
    strangers: dict[str, None] = {}
    for file in files_of(path):
        with opened_sheet(file, form_of(ruleset)) as sheet:
            names = sheet.titles
            header = assign(file, names, ruleset, [], sheet.units)
        found: dict[str, str] = {}
        for target in header.targets:
            title = names[target.index].strip()
            found[target.signal] = " and ".join(filter(None, (found.get(target.signal), title)))
        titles |= found
        strangers |= dict.fromkeys(header.strangers)
    return titles, [*strangers]


SHOWN = 4
"""Names shown from a list; the others are counted."""


def tell(out: Console, name: str, facts: Facts) -> None:
    """Print the columns, what can run, how much is settled, and what a mismatch could find."""
    rows = plural(facts["rows"], "row", "rows")
    out.print(styled("{}: {} over {}", name, rows, duration(facts["seconds"])))
    out.print(shown(_columns(facts["readings"])))
    for note in facts["notes"]:
        out.print(styled("[dim]note: {}[/]", note))
    if facts["settled"] is None:
        out.print("the plant has storage: it is judged while it moves, not only when settled")
    else:
        share, stretches = f"{100 * facts['settled']:.0f}", facts["stretches"]
        where = plural(stretches, "stretch", "stretches")
        out.print(styled("settled: {} % of the rows, in {}", share, where))
    for key, what in (
        ("estimates", "flow estimates available"),
        ("comparisons", "comparisons between them"),
        ("faults", "detectable faults"),
    ):
        count, every = facts[key]
        line = "[green]✓[/] {}: {} of {}" if count == every else "[yellow]![/] {}: {} of {}"
        out.print(styled(line, what, count, every))
    if facts["blind"]:
        out.print(styled("  undetectable: {}", _some(facts["blind"])))
    for lack in facts["lacks"]:
        parts = [f"no {_some(lack['estimates'])}"] if lack["estimates"] else []
        if fewer := len(lack["comparisons"]):
            parts.append(plural(fewer, "fewer comparison", "fewer comparisons"))
        if lack["effects"]:
            parts.append(f"mismatch cannot find {_some(lack['effects'])}")
        waiting = "; ".join(parts) or "its balance cannot be followed"
        out.print(styled("  without {} ({}): {}", lack["signal"], lack["why"], waiting))
    reveals = "this recording could reveal {} of {} known effects (`rulec show effects PLANT`)"
    out.print(styled(reveals, *facts["effects"]))
    for quantity, names in facts["unread"].items():
        out.print(styled("  with a sensor for {} also: {}", quantity, _some(names)))


def _columns(readings: Sequence[Mapping[str, Any]]) -> Table:
    rows = []
    for one in readings:
        title, odd, used = one["title"], one["odd"], one["used"]
        if not title and not used:
            continue  # nothing reads it
        remark = "; ".join(odd) or one["unit"] + ("" if used else ", read by no equation")
        mark = styled("[yellow]![/]") if odd else "✓"
        if not title:
            mark, remark = styled("[red]-[/]"), "not in the recording"
        ends = (one[key] for key in ("low", "middle", "high"))
        numbers = ("" if end is None else f"{end:.4g}" for end in ends)
        rows.append((mark, one["signal"], title or "-", *numbers, remark))
    return Table(("", "signal", "column", ".lowest", ".median", ".highest", ""), rows)


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
