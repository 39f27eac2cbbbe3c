"""ZeMA hydraulic rig: commission on some blocks, diagnose the others, score whole cycles.

The labels of `conditions.csv` choose the commissioning cycles (settled, no leakage, every third
such block) and score; no method reads them otherwise.

``python -m tests.rig.zema`` prints the figures as JSON.
"""

import csv
import gzip
import json
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.conftest import ROOT, recordings_folder
from tests.figures.ledger import Share
from tests.rig.called import called, commissioned

CYCLE = 60.0
PLANTS = {"with temperature": "plant.yaml", "without temperature": "without-temperature.yaml"}
LOADED = 14.0
"""Second of a cycle from which on the load valve is open and its transient over."""

PROFILE = 172.0
"""Bar; the highest plateau of the load profile is 167 bar in every leak-free cycle."""


@dataclass(frozen=True)
class Cycle:
    """What was set in one cycle; `off_profile`: when the pressure left its profile."""

    number: int
    block: int
    leakage: int
    settled: bool
    off_profile: tuple[float, ...]


@dataclass(frozen=True)
class Judged:
    """A whole cycle of an unseen block: whether anything is found in it, and a leakage; the degree
    of that, 0 without one; whether nothing known explains something; seconds off the profile in
    which a fault is named."""

    cycle: Cycle
    alarmed: bool
    leaks: bool
    degree: float
    unknown: bool
    named_off: int


def split(folder: Path, cycles: list[Cycle], work: Path) -> set[int]:
    """Write leak-free cycles of commissioning blocks, and all others; returns those blocks."""
    healthy = [c for c in cycles if c.leakage == 0 and c.settled]
    blocks = set(sorted({c.block for c in healthy})[::3])
    chosen = {c.number for c in healthy if c.block in blocks}
    write_cycles(folder, chosen, work / "commissioning.csv")
    write_cycles(folder, {c.number for c in cycles if c.block not in blocks}, work / "unseen.csv")
    return blocks


def read_cycles(folder: Path) -> list[Cycle]:
    """Labels, and whether the working pressure kept to its profile."""
    off: dict[int, list[float]] = {}
    with gzip.open(folder / "recording.csv.gz", "rt", encoding="utf-8") as file:
        rows = csv.reader(file)
        header = next(rows)
        time, cycle, pressure = (header.index(n) for n in ("time [s]", "cycle", "PS1 [bar]"))
        for row in rows:
            if float(row[time]) % CYCLE >= LOADED and float(row[pressure]) > PROFILE:
                off.setdefault(int(row[cycle]), []).append(float(row[time]))
    with (folder / "conditions.csv").open(encoding="utf-8") as file:
        return [
            Cycle(
                int(r["cycle"]),
                int(r["block"]),
                int(r["pump_leakage"]),
                r["stable_flag"] == "0",
                tuple(off.get(int(r["cycle"]), ())),
            )
            for r in csv.DictReader(file)
        ]


def write_cycles(folder: Path, cycles: Iterable[int], target: Path) -> None:
    wanted = {str(c) for c in cycles}
    with gzip.open(folder / "recording.csv.gz", "rt", encoding="utf-8") as source:
        rows = csv.reader(source)
        header = next(rows)
        index = header.index("cycle")
        with target.open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            writer.writerow(header)
            writer.writerows(row for row in rows if row[index] in wanted)


def score(
    diagnosis: Mapping[str, Any], cycles: list[Cycle], commissioning: set[int]
) -> list[Judged]:
    judged = []
    for cycle in (c for c in cycles if c.block not in commissioning):
        start, end = CYCLE * cycle.number, CYCLE * (cycle.number + 1)
        found = _within(diagnosis["findings"], start, end)
        unknown = _within(diagnosis["unknown"], start, end)
        leaks = [f["degree"] for f in found if "main.leakage" in _causes(f)]
        off = [t for t in cycle.off_profile if any(f["since"] <= t <= f["until"] for f in found)]
        result = bool(found), bool(leaks), max(leaks, default=0.0), bool(unknown), len(off)
        judged.append(Judged(cycle, *result))
    return judged


def _within(entries: list[dict[str, Any]], start: float, end: float) -> list[dict[str, Any]]:
    return [e for e in entries if e["since"] < end and e["until"] >= start]


def _causes(finding: Mapping[str, Any]) -> set[str]:
    return {finding["fault"], *(a["fault"] for a in finding["alternatives"])}


def run(folder: Path, plant: str) -> list[Judged]:
    """Calibrate one pump law on commissioning blocks, diagnose and score all others."""
    cycles = read_cycles(folder)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        commissioning = split(folder, cycles, work)
        shutil.copytree(ROOT / "plants" / "zema-hydraulic", work / "plant")
        file = work / "plant" / PLANTS[plant]
        commissioned(file, work / "commissioning.csv")
        called("diagnose", file, work / "unseen.csv", "--json", work / "diagnosis.json")
        diagnosis = json.loads((work / "diagnosis.json").read_text(encoding="utf-8"))
    return score(diagnosis, cycles, commissioning)


def by_label(judged: list[Judged]) -> dict[str, list[Judged]]:
    """Cycles without a leakage, with a weak and with a severe one."""
    names = enumerate(("healthy", "weak", "severe"))
    return {name: [j for j in judged if j.cycle.leakage == size] for size, name in names}


def form(judged: list[Judged]) -> dict[str, Any]:
    """Machine form, as the README counts."""
    cycles, off = by_label(judged), [j.unknown for j in judged if j.cycle.off_profile]
    found = {"healthy alarmed": [j.alarmed for j in cycles["healthy"]]}
    found |= {f"{name} found": [j.leaks for j in cycles[name]] for name in ("weak", "severe")}
    found["off profile unknown"] = off
    return {name: Share(sum(flags), len(flags)).form() for name, flags in found.items()}


if __name__ == "__main__":
    measured = {law: form(run(recordings_folder() / "zema-hydraulic", law)) for law in PLANTS}
    print(json.dumps(measured, indent=1))
