"""Drawn pairs of a fault and a sensor problem or an odd way to run the plant."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from tests.figures.ledger import Share
from tests.rig.long_run import plants
from tests.rig.long_run.plants import LIQUID, Columns, Right, asked, changed, clock, constant, plant

DRAWN = 300
ROWS = 360
BREAKS, LEAKS = 60, 180
"""Rows from which on a reading is wrong, and the plant."""

ALONG = np.arange(ROWS) / ROWS
"""Part of the recording that has gone by, shape (ROWS,)."""

VERDICTS = ("right", "wrong", "ok", "without a name")
"""The fault is told, first or as an alternative; else another one with 90 %; else nothing is told;
else something is."""

KINDS: Mapping[str, tuple[float, float]] = {
    "leakage": (0.15, 0.6),
    "clogging": (0.2, 0.8),
    "widening": (0.15, 0.5),
}
"""Least and largest degree of a fault."""

Random = np.random.Generator
Broken = Callable[[Columns, str, Random], Columns]

READINGS: Mapping[str, Broken] = {
    "frozen": lambda c, s, r: plants.held(c, s, BREAKS),
    "clipped": lambda c, s, r: plants.clipped(c, s, float(r.uniform(0.05, 0.5))),
    "dead": lambda c, s, r: plants.held(c, s, BREAKS, 0.0),
    "no column": lambda c, s, r: plants.absent(c, s),
    "lost later": lambda c, s, r: plants.held(c, s, BREAKS, np.nan),
    "gaps": lambda c, s, r: changed(c, s, lambda v: plants.gaps(v, r.uniform(0.1, 0.6), r)),
    "too high": lambda c, s, r: changed(c, s, lambda v: v * (1.0 + r.uniform(0.05, 0.3))),
    "too low": lambda c, s, r: changed(c, s, lambda v: v * (1.0 - r.uniform(0.05, 0.3))),
    "drift": lambda c, s, r: changed(c, s, lambda v: v * (1.0 + r.uniform(0.05, 0.2) * ALONG)),
    "offset": lambda c, s, r: changed(c, s, lambda v: v + r.uniform(0.05, 0.2) * v.mean()),
    "noise": lambda c, s, r: changed(c, s, lambda v: v + _noise(v, r.uniform(0.02, 0.08), r)),
    "spikes": lambda c, s, r: changed(c, s, lambda v: plants.spikes(v, r.uniform(0.01, 0.05), r)),
    "late": lambda c, s, r: changed(c, s, lambda v: _late(v, int(r.integers(2, 8)))),
    "swapped": lambda c, s, r: plants.swapped(c, s, _other(c, s)),
    "unit": lambda c, s, r: plants.all_in(c, s.split(".")[1], float(r.choice([1e-3, 0.1, 100.0]))),
}
"""What goes wrong with a reading, by name."""

RUNS = ("pump off", "ramps", "restless", "cold liquid", "starts late")
"""Odd ways to run the plant."""

PROBLEMS = (*READINGS, *RUNS)


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A fault and a problem; `signal` where it is one of a reading."""

    number: int
    rig: str
    fault: str
    degree: float
    problem: str
    signal: str
    moves: bool

    @property
    def what(self) -> str:
        points = "moving" if self.moves else "constant"
        return f"{self.rig}, {points}: {self.fault} {self.degree:.2f}, {self.problem} {self.signal}"


def draw(number: int) -> Pair:
    """One pair; problems come in turn, the rest is drawn."""
    random = np.random.default_rng([52, number])
    rig = "abc" if random.uniform() < 0.7 else "mixing-rig"
    problem = PROBLEMS[number % len(PROBLEMS)]
    built = plant(rig)
    # The centrifugal pump E cannot lift what a clogged wide mixer asks for.
    modules = [name for name in (*built.rig.pumps, *built.rig.mixers) if name != "M2"]
    module = str(random.choice(modules))
    kind = str(random.choice(list(KINDS) if module in built.modules else ["clogging", "widening"]))
    near = str(random.choice(list(built.modules)))
    if module in built.modules and random.uniform() < 0.5:
        near = module
    signal = f"{near}.{random.choice(['n', 'dp', 'dp', 'P_el'])}"
    if problem in ("unit", "swapped"):
        signal = f"{near}.dp"
    return Pair(
        number=number,
        rig=rig,
        fault=f"{module}.{kind}",
        degree=float(random.uniform(*KINDS[kind])),
        problem=problem,
        signal=signal if problem in READINGS else "",
        moves=bool(random.uniform() < 0.5),
    )


def readings_of(pair: Pair) -> Columns:
    random = np.random.default_rng([53, pair.number])
    time, rig, built = clock(ROWS), pair.rig, plant(pair.rig)
    speed = plants.moving(rig, time, 45, random) if pair.moves else constant(rig, time)
    is_cold = pair.problem == "cold liquid"
    faults = plants.everywhere(built, np.full(ROWS, 0.15)) if is_cold else {}
    there = np.where(time >= LEAKS, pair.degree, 0.0)
    before = faults.get(pair.fault, np.zeros(ROWS))
    faults[pair.fault] = (1.0 + before) * (1.0 + there) - 1.0 if before.any() else there
    backflow = False
    if pair.problem == "pump off":
        off = str(random.choice([n for n in built.modules if n != pair.fault.split(".")[0]]))
        speed = {**speed, off: np.where(time >= BREAKS, 0.0, speed[off])}
        built, backflow = plants.idle(built, off, time >= BREAKS), True
    elif pair.problem in ("ramps", "restless"):
        period, size = (90.0, 0.12) if pair.problem == "ramps" else (9.0, 0.06)
        speed = {n: v * (1.0 + size * np.sin(6.283 * time / period)) for n, v in speed.items()}
    elif is_cold:
        built = plants.scaled(built, plants.SLIP, np.full(ROWS, 0.8))
    elif pair.problem == "starts late":
        time = clock(ROWS) + np.where(clock(ROWS) >= BREAKS, 4.0 * 3600.0, 0.0)
    columns = plants.recorded(
        rig, time, 9_000 + pair.number, faults, speed=speed, built=built, backflow=backflow
    )
    return READINGS[pair.problem](columns, pair.signal, random) if pair.signal else columns


def right_of(pair: Pair) -> Right:
    """What may be told."""
    also = [rf"{pair.signal}\."] if pair.signal else []
    if pair.problem in ("swapped", "unit"):
        also = [r".*\.dp\."]
    states = {"cold liquid": (LIQUID,), "pump off": ("off|stands",)}.get(pair.problem, ())
    return Right(faults={pair.fault: pair.degree}, states=states, also=(*also, r"time\."))


def measure() -> dict[str, Any]:
    """How often each verdict is given, and all that is not right."""
    pairs, misses, verdicts = [draw(number) for number in range(DRAWN)], [], Counter[str]()
    for pair in pairs:
        said = asked(pair.rig, readings_of(pair))
        if any(pair.fault in plants.names_of(f) for f in said["findings"]):
            verdict = "right"
        elif any(plants.surely_wrong(right_of(pair), said)):
            verdict = "wrong"
        else:
            verdict = "ok" if said["status"] == "ok" else "without a name"
        verdicts[verdict] += 1
        if verdict != "right":
            misses.append({"what": pair.what, "verdict": verdict, "said": plants.in_a_line(said)})
    shares = {verdict: Share(verdicts[verdict], len(pairs)) for verdict in VERDICTS}
    counts = {name: f"{s.count} of {s.of} ({s.value:.1%})" for name, s in shares.items()}
    return {"counts": counts, "misses": misses}


def _noise(values: Array, share: float, random: Random) -> Array:
    return np.asarray(share * values.mean() * random.normal(size=values.size))


def _late(values: Array, rows: int) -> Array:
    return np.concatenate([np.full(rows, values[0]), values[:-rows]])


def _other(columns: Columns, signal: str) -> str:
    """Another pressure, of a mixer if there is one left."""
    names = [n.split(" [")[0] for n in columns if ".dp [" in n]
    return [name for name in names if name != signal][-1]
