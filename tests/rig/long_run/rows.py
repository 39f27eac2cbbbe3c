"""The ten rows: each makes recordings of both rigs and says what is right."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from tests.rig.long_run import plants
from tests.rig.long_run.plants import Columns, Form, Right, clock, constant, plant, recorded

RIGS = ("abc", "mixing-rig")
HOUR = 3600
SHORT = 300
"""Rows of a recording in which something breaks; it does so at a third."""

HERE = SHORT // 3


Asked = tuple[str, Columns, Right] | tuple[str, Columns, Right, Callable[[str, Columns], Form]]
"""A variant, its recording, the right answer, and the way to ask: else `asked` of `plants`."""


def growth(rig: str, seed: int) -> Iterator[Asked]:
    time = clock(HOUR)
    for fault, degree in (("A.leakage", 0.5), ("A.clogging", 2.0)):
        columns = recorded(rig, time, seed, {fault: np.linspace(0.0, degree, HOUR)})
        right = Right(faults={fault: degree}, grows=True)
        yield f"{fault} file", columns, right
        yield f"{fault} live", columns, right, plants.watched


def drifts(rig: str, seed: int) -> Iterator[Asked]:
    """A transmitter drifts by 10 % in two hours; then the second of them alone."""
    rows = 2 * HOUR
    for signal in ("dp", "P_el"):
        course = {f"A.{signal}.high": np.linspace(0.0, 0.1, rows)}
        columns = recorded(rig, clock(rows), seed, course)
        half = {name: column[HOUR:] for name, column in columns.items()}
        right = Right(sensors=(f"A.{signal}.",))
        yield f"{signal}, two hours", columns, right
        yield f"{signal}, second hour", half, right


def fast_reading(rig: str, seed: int) -> Iterator[Asked]:
    """A speed is read too high, the plant is sound."""
    for share in (0.1, 0.2, 0.3):
        columns = recorded(rig, clock(SHORT), seed)
        columns = plants.changed(columns, "A.n", partial(np.multiply, 1.0 + share))
        yield f"n {share:.0%} high", columns, Right(sensors=("A.n.",))


def blind(rig: str, seed: int) -> Iterator[Asked]:
    """A pressure reading is gone, and a pump leaks."""
    leak = _step(0.6)
    columns = recorded(rig, clock(SHORT), seed, {"A.leakage": leak})
    cells: Mapping[str, Callable[[str], Columns]] = {
        "no column": lambda signal: plants.absent(columns, signal),
        "empty": lambda signal: plants.held(columns, signal, 0, np.nan),
        "from row 50": lambda signal: plants.held(columns, signal, 50, np.nan),
    }
    hidden = Right(blind=("A.leakage",), also=("A.", "C.", "M1."))
    for name, without in cells.items():
        yield f"A.dp {name}", without("A.dp"), hidden, plants.command
    seen = Right(faults={"A.leakage": 0.6}, blind=("B.leakage",), also=("B.",))
    yield "B.dp no column", cells["no column"]("B.dp"), seen, plants.command


def comes_and_goes(rig: str, seed: int) -> Iterator[Asked]:
    """A leakage for 2 s of every 10."""
    rows, degree = 2 * SHORT, 0.4
    time = clock(rows)
    leak = np.where((time % 10.0 < 2.0) & (time >= 20.0), degree, 0.0)
    columns = recorded(rig, time, seed, {"A.leakage": leak})
    events = (int(np.sum(np.diff(leak) > 0.0)), 2.0)
    yield "2 s of 10", columns, Right(faults={"A.leakage": degree}, events=events)


def cold(rig: str, seed: int) -> Iterator[Asked]:
    """The liquid gets cold: more friction, less slip, everywhere at once."""
    there = _step(1.0)
    built = plants.scaled(plant(rig), plants.SLIP, 1.0 - 0.2 * there)
    faults = plants.everywhere(plant(rig), 0.15 * there)
    falls = dict.fromkeys(plant(rig).modules, 293.15 - 10.0 * there)
    right = Right(states=(plants.LIQUID,))
    for variant, temperature in (("T recorded", falls), ("T as usual", {})):
        columns = recorded(rig, clock(SHORT), seed, faults, built=built, temperature=temperature)
        yield variant, columns, right


def pump_states(rig: str, seed: int) -> Iterator[Asked]:
    """Liquid runs back through a pump that is off; a closed valve; no liquid."""
    time, speed = clock(SHORT), constant(rig, clock(SHORT))
    name = "A" if rig == "abc" else "E"
    off = {**speed, "A": np.where(time >= HERE, 0.0, speed["A"])}
    back = plants.idle(plant(rig), "A", time >= HERE, plants.OPEN)
    columns = recorded(rig, time, seed, speed=off, built=back, backflow=True)
    right = Right(states=("reverse|back ?flow|runs back",), also=("A.",))
    yield "A off, reverse flow", columns, right
    # A displacement pump would burst the line at its usual speed; at a third it stays in range.
    slow = {**speed, "A": np.full(SHORT, 5.0)} if rig == "abc" else speed
    shut = {f"{name}.clogging": _step(1e4)}
    columns = recorded(rig, time, seed, shut, speed=slow, backflow=True)
    right = Right(states=("dead.?head|closed valve|shut",), also=(f"{name}.clogging",))
    yield f"{name} dead-heading", columns, right
    built = plants.idle(plant(rig), name, time >= HERE)
    columns = recorded(rig, time, seed, built=built, backflow=True)
    right = Right(states=(r"\bdr(y|ies)\b|runs.dry|dry.run",), also=(f"{name}.leakage",))
    yield f"{name} dry", columns, right


def leak_behind_sensor(rig: str, seed: int) -> Iterator[Asked]:
    """A leakage, and a frozen or clipped pressure of the same module."""
    time = clock(SHORT)
    for speeds in ("constant", "moving"):
        random = np.random.default_rng(seed)
        speed = (
            constant(rig, time) if speeds == "constant" else plants.moving(rig, time, 50, random)
        )
        columns = recorded(rig, time, seed, {"A.leakage": _step(0.4, 2 * HERE)}, speed=speed)
        right = Right(faults={"A.leakage": 0.4}, sensors=("A.dp.",))
        broken = {
            "frozen": plants.held(columns, "A.dp", HERE),
            "clipped": plants.clipped(columns, "A.dp", 0.02 if speeds == "constant" else 0.3),
        }
        for name, shown in broken.items():
            yield f"A.dp {name}, {speeds} speeds", shown, right


def mistaken_table(rig: str, seed: int) -> Iterator[Asked]:
    """Two columns swapped, or all pressures in another unit, and a leakage."""
    columns = recorded(rig, clock(SHORT), seed, {"A.leakage": _step(0.4)})
    mixer = next(iter(plant(rig).rig.mixers))
    for variant, shown, mistake in (
        ("A.dp, mixer swapped", plants.swapped(columns, "A.dp", f"{mixer}.dp"), "dp.swapped"),
        ("dp in kPa", plants.all_in(columns, "dp", 100.0), "dp.unit"),
        ("dp in MPa", plants.all_in(columns, "dp", 0.1), "dp.unit"),
    ):
        right = Right(faults={"A.leakage": 0.4}, states=(mistake,), also=(r".*\.dp\.",))
        yield variant, shown, right


def three_leaks(rig: str, seed: int) -> Iterator[Asked]:
    """Three pumps leak at once; of two pumps, both."""
    degrees = {f"{name}.leakage": d for name, d in zip("ABC", (0.3, 0.4, 0.2), strict=True)}
    faults = {name: d for name, d in degrees.items() if name[0] in plant(rig).modules}
    columns = recorded(rig, clock(SHORT), seed, {name: _step(d) for name, d in faults.items()})
    yield f"{len(faults)} leaks", columns, Right(faults=faults)


ROWS: Mapping[str, Callable[[str, int], Iterator[Asked]]] = {
    "growth": growth,
    "drift": drifts,
    "speed reading": fast_reading,
    "reading gone": blind,
    "comes and goes": comes_and_goes,
    "cold liquid": cold,
    "pump states": pump_states,
    "leak behind sensor": leak_behind_sensor,
    "mistaken table": mistaken_table,
    "three leaks": three_leaks,
}


def measure() -> dict[str, Any]:
    """All rows on both rigs: what was said of each recording, and what is wrong with that."""
    answers = []
    for (row, questions), rig in product(ROWS.items(), RIGS):
        for variant, columns, right, *how in questions(rig, 0):
            said = (how[0] if how else plants.asked)(rig, columns)
            about = {"row": row, "variant": variant, "rig": rig, "said": plants.in_a_line(said)}
            answers.append({**about, "complaints": plants.complaints(right, said)})
    fine = sum(not answer["complaints"] for answer in answers)
    return {"recordings": len(answers), "right": fine, "answers": answers}


def _step(degree: float, first: int = HERE) -> np.ndarray:
    """Nothing, then a degree, for a short recording."""
    return np.where(np.arange(SHORT) >= first, degree, 0.0)
