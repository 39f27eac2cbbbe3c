"""Rigs as they are compiled and as they truly are; recordings of them; the tool asked of one."""

import functools
import json
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form

from rulec.cli import main
from rulec.commands.arguments import recording_given
from rulec.prove.truth.settled.drive import approach
from rulec.prove.truth.settled.solve import Operated, State, Term
from rulec.prove.truth.units import BAR, LITRE_PER_HOUR
from tests.conftest import compiled
from tests.dosing import TABLE_1, Plant, record, write_csv
from tests.dosing.plant import LIQUID_TEMPERATURE, Operation
from tests.dosing.runs import HIGHEST, LOWEST, Run
from tests.method.readings import built as plant
from tests.rig.follower.plants import followed

Columns = Mapping[str, Array]


def title(columns: Columns, signal: str) -> str:
    """The header of a signal: `A.dp [bar]` of `A.dp`."""
    return next(name for name in columns if name.startswith(f"{signal} ["))


def changed(columns: Columns, signal: str, change: Callable[[Array], Array]) -> Columns:
    """Other values for a signal, in the unit shown."""
    name = title(columns, signal)
    return {**columns, name: change(columns[name])}


def absent(columns: Columns, signal: str) -> Columns:
    return {name: v for name, v in columns.items() if name != title(columns, signal)}


def held(columns: Columns, signal: str, first: int, value: float | None = None) -> Columns:
    """One value from a row on: that of the row, or a given one (NaN is an empty cell)."""
    return changed(
        columns,
        signal,
        lambda v: np.where(np.arange(v.size) < first, v, v[first] if value is None else value),
    )


def clipped(columns: Columns, signal: str, share: float) -> Columns:
    """Cut off at the value that this share of the readings does not reach."""
    return changed(columns, signal, lambda v: np.minimum(v, np.quantile(v, share)))


def swapped(columns: Columns, one: str, other: str) -> Columns:
    """Two columns under each other's header."""
    a, b = title(columns, one), title(columns, other)
    return {**columns, a: columns[b], b: columns[a]}


def all_in(columns: Columns, signal: str, factor: float) -> Columns:
    """All columns of a signal, of every module, in another unit than the header says."""
    return {
        name: v * factor if name.split(" [")[0].endswith(f".{signal}") else v
        for name, v in columns.items()
    }


def spikes(values: Array, share: float, random: np.random.Generator) -> Array:
    """Half or twice the value here and there."""
    hit = random.uniform(size=values.size) < share
    return values * np.where(hit, random.choice([0.5, 2.0], values.size), 1.0)


def gaps(values: Array, share: float, random: np.random.Generator) -> Array:
    """Empty cells here and there."""
    return np.where(random.uniform(size=values.size) < share, np.nan, values)


Form = Mapping[str, Any]
"""What `diagnose --json` writes."""

BLOCK = 60
"""Rows that a watch gets at once."""

QUICK = 5.0
"""Seconds between rows below which a speed is seen on its way to a new set point."""


def clock(rows: int, interval: float = 1.0) -> Array:
    return interval * np.arange(rows, dtype=np.float64)


def constant(rig: str, time: Array) -> dict[str, Array]:
    """All speeds at their nominal value, rev/s."""
    return {name: np.full(time.size, m.speed) for name, m in plant(rig).modules.items()}


def moving(rig: str, time: Array, dwell: int, random: np.random.Generator) -> dict[str, Array]:
    """New speeds for all modules every `dwell` rows, rev/s, inside what every pump can do."""
    found = {}
    for name, module in plant(rig).modules.items():
        share = random.uniform(LOWEST, HIGHEST, -(-time.size // dwell))
        points = module.slowest + share * (module.fastest - module.slowest)
        points[0] = module.speed
        setting = np.repeat(points, dwell)[: time.size]
        found[name] = approach(time, setting, 1.0) if time[1] < QUICK else setting
    return found


def recorded(
    rig: str,
    time: Array,
    seed: int,
    faults: Mapping[str, Array] | None = None,
    *,
    speed: Mapping[str, Array] | None = None,
    built: Plant | None = None,
    temperature: Mapping[str, Array] | None = None,
    backflow: bool = False,
) -> Columns:
    """Readings with the errors of the rig's sensors, by header, in trade units."""
    operation = Operation(time, speed or constant(rig, time), temperature=temperature or {})
    run = Run(built or plant(rig), operation, faults or {}, backflow)
    return record(run, TABLE_1, seed).readings


def given(rig: str, columns: Columns) -> Recording:
    return recording_given([dict(columns)], compiled(rig))


def asked(rig: str, columns: Columns) -> Form:
    """What the tool says of a whole recording."""
    return diagnosis_form(diagnose(given(rig, columns), compiled(rig)))


def watched(rig: str, columns: Columns) -> Form:
    """What a watch says when the recording has been played through it to its end."""
    return diagnosis_form(followed(compiled(rig), given(rig, columns), BLOCK).diagnosis)


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="rulec-long-run-")


def command(rig: str, columns: Columns) -> Form:
    """What the command writes for a CSV file, with its exit code under `exit`."""
    folder = Path(_folder().name)
    rules, file, said = folder / f"{rig}.json", folder / "recording.csv", folder / "said.json"
    if not rules.exists():
        rules.write_text(compiled(rig).to_json(), encoding="utf-8")
    write_csv(file, columns, digits=8)
    words: Sequence[object] = ("diagnose", rules, file, "--quiet", "--json", said)
    try:
        code = main([str(word) for word in words])
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    return {**json.loads(said.read_text(encoding="utf-8")), "exit": code}


OPEN = 2.0e-6 * BAR / LITRE_PER_HOUR**2
"""What a standing pump that lets liquid back loses, Pa/(m3/s)2. Origin: assumed; less than half of
its line."""

SHUT = 1.0e4 * OPEN
"""The same with a check valve, which lets nothing through."""

DRY_POWER = 0.3
"""Shaft power of a centrifugal pump full of air, as a share of that against a closed valve. Origin:
assumed; bearings, seal and motor stay."""

VISCOSITY_PER_KELVIN = 0.024
"""Fall of the viscosity of water per kelvin, as a share. Origin: assumed; water, 20 degC."""

BLASIUS = 0.25
"""Exponent of the viscosity in the friction of a smooth turbulent line (Blasius)."""


def idle(plant: Plant, name: str, when: Array, back: float = SHUT) -> Plant:
    """Return the plant with a pump that does not pump for a while: off, or dry.

    Parameters
    ----------
    when : shape (n,), bool; when it does not, and is a passage instead: dp = -back Q |Q|
    back : Pa/(m3/s)2; of a check valve, `SHUT`
    """
    kind, own = plant.rig.kind(name), Operated(plant.rig, plant.values, {}).parameters(name)

    def passage(s: State) -> Array:
        through = -np.sign(s.pressure) * np.sqrt(np.abs(s.pressure) / back)
        return np.where(when, through, np.nan)

    def power(s: State) -> Array:
        """Of a dry pump that of friction alone, of one that is off none."""
        none = np.zeros_like(s.flow)
        dry = kind.power(own, s.speed, none, none) * (DRY_POWER if kind.by_head else 1.0)
        return np.where(when, dry * (s.speed > 0.0) - s.power, 0.0)

    return replace(
        plant, terms=(*plant.terms, Term("passage", name, passage), Term("power", name, power))
    )


SLIP = (".C0", ".C1", ".C2")
"""Ends of the names of what a displacement pump's slip has as parameters."""


def scaled(plant: Plant, ends: tuple[str, ...], factor: Array) -> Plant:
    """The plant with parameters times a factor, shape (n,), by the ends of their names."""
    return plant.with_values({n: v * factor for n, v in plant.values.items() if n.endswith(ends)})


def everywhere(plant: Plant, friction: Array) -> dict[str, Array]:
    """More friction (a share, shape (n,)) in all lines and mixers, as faults of the truth."""
    more, less = np.maximum(friction, 0.0), np.maximum(-friction, 0.0)
    names = [*plant.rig.pumps, *plant.rig.mixers]
    found = {f"{name}.clogging": more for name in names}
    return found | ({f"{name}.widening": less for name in names} if less.any() else {})


def water_at(plant: Plant, temperature: Array) -> tuple[Plant, dict[str, Array]]:
    """The plant with water of some temperature, K: slip follows 1/viscosity, friction Blasius."""
    thicker = np.exp(-VISCOSITY_PER_KELVIN * (temperature - LIQUID_TEMPERATURE))
    return scaled(plant, SLIP, 1.0 / thicker), everywhere(plant, thicker**BLASIUS - 1.0)


SURE = 0.9
"""Probability from which on a wrong answer is a sure one."""

CLOSE = 0.05
"""How far a degree may be off, as a share of it."""

USEFUL = 0.2
"""Half width of bounds, as a share of the degree, up to which they help. Origin: assumed."""

LIQUID = r"liquid|fluid|viscos"
"""In name or text of a finding that blames the liquid."""


@dataclass(frozen=True, kw_only=True)
class Right:
    """What should be told of a recording.

    Attributes
    ----------
    faults : degree at the end by fault; named first or as an alternative
    sensors : beginnings of what is found of readings, such as `A.n.`; each is told
    states : patterns in name or text of findings, such as a pump that runs dry; each is told
    grows : whether the course of the degree is told: `now`
    blind : faults that cannot be seen, which are told as such, with status `C` and an exit code
    events : how often, and for how many seconds each time: `events: {count, duration}`
    also : what may be told beside it, as patterns of names
    """

    faults: Mapping[str, float] = field(default_factory=dict)
    sensors: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    grows: bool = False
    blind: tuple[str, ...] = ()
    events: tuple[int, float] | None = None
    also: tuple[str, ...] = ()


def names_of(finding: Form) -> set[str]:
    """The fault of a finding, and what else it may be."""
    others = {str(other["fault"]) for other in finding.get("alternatives", ())}
    return {str(finding["fault"]), *others, *map(str, finding.get("together", ()))}


def last_of(form: Form, fault: str) -> Form | None:
    """The latest finding that names a fault first."""
    mine = [f for f in form["findings"] if f["fault"] == fault]
    return max(mine, key=lambda f: float(f["until"]), default=None)


def now_of(finding: Form) -> tuple[float, float, float]:
    """Degree with bounds at the end; where no course is told, those of the whole finding."""
    now: Mapping[str, Any] = finding.get("now") or finding
    return float(now["degree"]), float(now["lower"]), float(now["upper"])


def width_of(finding: Form) -> float:
    _, lower, upper = now_of(finding)
    return (upper - lower) / 2.0


def is_within(bounds: tuple[float, float, float], degree: float) -> bool:
    """Is a degree close to the true one, or do its bounds hold it?"""
    said, lower, upper = bounds
    return abs(said - degree) <= CLOSE * degree or lower <= degree <= upper


def complaints(right: Right, form: Form) -> list[str]:
    found = [*_faults(right, form), *_sensors(right, form), *_blind(right, form)]
    for pattern in right.states:
        causes = [*form["findings"], *form["regimes"]]
        if not any(re.search(pattern, _words(f), re.IGNORECASE) for f in causes):
            found.append(f"no finding says {pattern}")
    found += [f"surely wrong: {name}" for name in surely_wrong(right, form)]
    return found


def surely_wrong(right: Right, form: Form) -> Iterator[str]:
    """Faults that are told as sure, though they are not there and nothing true is beside them."""
    patterns = [*(re.escape(s) for s in (*right.faults, *right.sensors)), *right.also]
    for finding in form["findings"]:
        if finding["kind"] == "sensor" and not right.sensors and not right.also:
            yield str(finding["fault"])
        if finding["kind"] == "sensor" or float(finding["probability"]) < SURE:
            continue
        if any(re.search(pattern, _words(finding), re.IGNORECASE) for pattern in right.states):
            continue
        if not any(re.match(p, name) for p in patterns for name in names_of(finding)):
            yield f"{finding['fault']} {float(finding['degree']):.3g}"


def _faults(right: Right, form: Form) -> Iterator[str]:
    for fault, degree in right.faults.items():
        if not any(fault in names_of(f) for f in form["findings"]):
            yield f"{fault} is not named"
            continue
        finding = last_of(form, fault)
        if finding is None:
            continue
        if not is_within(now_of(finding), degree):
            said, lower, upper = now_of(finding)
            yield f"{fault} is {degree:.3g}, told {said:.3g} ({lower:.3g} to {upper:.3g})"
        if right.grows and "now" not in finding:
            yield f"{fault}: no course is told"
        if right.grows and width_of(finding) > USEFUL * degree:
            yield f"{fault}: {degree:.3g} is told within {width_of(finding):.2g} only"
        if right.events is not None:
            yield from _events(right.events, finding, form)


def _events(true: tuple[int, float], finding: Form, form: Form) -> Iterator[str]:
    events = finding.get("events")
    if events is None:
        yield "events are not counted"
        return
    count, duration = float(events["count"]), float(events["duration"])
    if abs(count - true[0]) > 0.1 * true[0] or abs(duration - true[1]) > 1.0:
        yield f"{true[0]} events of {true[1]:g} s, told {count:g} of {duration:g} s"
    if sum(f["fault"] == finding["fault"] for f in form["findings"]) > 1:
        yield "events are not pooled into one finding"


def _sensors(right: Right, form: Form) -> Iterator[str]:
    for start in right.sensors:
        names = [name for f in form["findings"] for name in names_of(f)]
        by_sheet = (f"{p['text']} " for p in form["unknown"])
        if not any(name.startswith(start) for name in names) and not any(
            f"the sheet is right, {start.rstrip('.')} " in text for text in by_sheet
        ):
            yield f"nothing is told of {start.rstrip('.')}"


def _blind(right: Right, form: Form) -> Iterator[str]:
    if not right.blind:
        return
    if form["status"] not in ("C", "F") or (form["status"] == "F" and not right.sensors):
        yield f"status {form['status']} instead of C"
    if form.get("exit") == 0:
        yield "exit code 0"
    faults = [f for f in form["findings"] if f["kind"] == "fault"]
    rest = json.dumps({**form, "findings": [f for f in form["findings"] if f not in faults]})
    for fault in right.blind:
        if fault not in rest:
            yield f"{fault} is not told as out of sight"


def _words(finding: Form) -> str:
    return f"{finding.get('fault') or finding.get('regime')} {finding.get('text', '')}"


def in_a_line(form: Form) -> str:
    """The answer in a line, latest findings last."""
    said = []
    for f in sorted(form["findings"], key=lambda f: float(f["until"]))[-4:]:
        degree, lower, upper = now_of(f)
        others = f" or {f['alternatives'][0]['fault']}" if f["alternatives"] else ""
        sure = f"{float(f['probability']):.0%}"
        said.append(f"{f['fault']} {degree:.3g} ({lower:.3g} to {upper:.3g}) {sure}{others}")
    more = len(form["findings"]) - len(said)
    said += [f"and {more} before"] if more > 0 else []
    said += ["nothing known fits"] if form["unknown"] else []
    return f"{form['status']}: {'; '.join(said)}" if said else str(form["status"])
