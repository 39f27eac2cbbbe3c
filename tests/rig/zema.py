"""ZeMA hydraulic rig: commission on some blocks, diagnose the others, score whole cycles.

The labels of `conditions.csv` choose the commissioning cycles (settled, no leakage, every third
such block) and score; no method reads them otherwise.

``python -m tests.rig.zema`` prints the figures as JSON.
"""

from __future__ import annotations

import contextlib
import csv
import gzip
import io
import json
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rulec.cli import main
from tests.conftest import ROOT, recordings_folder
from tests.figures.share import Share

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
class Score:
    """Counts over unseen blocks, by (label, settled), and mean degree per label."""

    cycles: Mapping[str, int]
    alarmed: Mapping[str, int]
    leak_named: Mapping[str, int]
    degree: Mapping[str, float]
    degree_range: Mapping[str, tuple[float, float]]
    off_profile: Mapping[str, int]


def commission_and_diagnose(
    folder: Path, plant: str, work: Path
) -> tuple[dict[str, Any], set[int]]:
    """Calibrate on commissioning blocks, diagnose all other blocks; returns JSON and blocks."""
    commissioning = split(folder, read_cycles(folder), work)
    place = work / "plants" / "zema-hydraulic"
    shutil.copytree(ROOT / "plants" / "zema-hydraulic", place)
    file = place / PLANTS[plant]
    lines = file.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line.startswith("calibration:")]
    file.write_text("\n".join([*kept, f"kb: {ROOT / 'kb'}"]) + "\n", encoding="utf-8")
    _call("calibrate", file, work / "commissioning.csv", "-o", place / "found.yaml")
    with file.open("a", encoding="utf-8") as out:
        out.write("calibration: [found.yaml]\n")
    _call("diagnose", file, work / "unseen.csv", "--json", work / "diagnosis.json")
    return json.loads((work / "diagnosis.json").read_text(encoding="utf-8")), commissioning


def split(folder: Path, cycles: list[Cycle], work: Path) -> set[int]:
    """Write leak-free cycles of commissioning blocks, and all others; returns those blocks."""
    healthy = [c for c in cycles if c.leakage == 0 and c.settled]
    blocks = set(sorted({c.block for c in healthy})[::3])
    chosen = {c.number for c in healthy if c.block in blocks}
    write_cycles(folder, chosen, work / "commissioning.csv")
    write_cycles(folder, {c.number for c in cycles if c.block not in blocks}, work / "unseen.csv")
    return blocks


def _call(*arguments: object) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        code = main([str(a) for a in arguments])
    assert code == 0, arguments


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
    """Copy some cycles of the recording."""
    wanted = {str(c) for c in cycles}
    with gzip.open(folder / "recording.csv.gz", "rt", encoding="utf-8") as source:
        rows = csv.reader(source)
        header = next(rows)
        index = header.index("cycle")
        with target.open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            writer.writerow(header)
            writer.writerows(row for row in rows if row[index] in wanted)


def score(diagnosis: Mapping[str, Any], cycles: list[Cycle], commissioning: set[int]) -> Score:
    """Per whole cycle: did anything alarm, was leakage among the causes named, how large."""
    names = {0: "none", 1: "weak", 2: "severe"}
    counts: dict[str, dict[str, int]] = {"cycles": {}, "alarmed": {}, "named": {}}
    degrees: dict[str, list[float]] = {}
    off = {"cycles": 0, "cycles with unknown": 0, "seconds": 0, "seconds with a fault named": 0}
    for cycle in (c for c in cycles if c.block not in commissioning):
        start, end = CYCLE * cycle.number, CYCLE * (cycle.number + 1)
        found = _within(diagnosis["findings"], start, end)
        key = f"{names[cycle.leakage]}, {'settled' if cycle.settled else 'unsettled'}"
        if cycle.off_profile:
            off["cycles"] += 1
            off["cycles with unknown"] += bool(_within(diagnosis["unknown"], start, end))
            off["seconds"] += len(cycle.off_profile)
            off["seconds with a fault named"] += sum(
                any(f["since"] <= t <= f["until"] for f in found) for t in cycle.off_profile
            )
            key += ", off profile"
        _count(counts["cycles"], key, True)
        _count(counts["alarmed"], key, bool(found))
        leaks = [f for f in found if "main.leakage" in _causes(f)]
        _count(counts["named"], key, bool(leaks))
        degrees.setdefault(key, []).append(max((f["degree"] for f in leaks), default=0.0))
    return Score(
        counts["cycles"],
        counts["alarmed"],
        counts["named"],
        {k: float(np.mean(v)) for k, v in degrees.items()},
        {k: (min(v), max(v)) for k, v in degrees.items()},
        off,
    )


def _within(entries: list[dict[str, Any]], start: float, end: float) -> list[dict[str, Any]]:
    return [e for e in entries if e["since"] < end and e["until"] >= start]


def _causes(finding: Mapping[str, Any]) -> set[str]:
    return {finding["fault"], *(a["fault"] for a in finding["alternatives"])}


def _count(table: dict[str, int], key: str, hit: bool) -> None:
    table[key] = table.get(key, 0) + hit


def run(folder: Path, plant: str) -> Score:
    """The whole experiment with one pump law."""
    with tempfile.TemporaryDirectory() as work:
        diagnosis, commissioning = commission_and_diagnose(folder, plant, Path(work))
    return score(diagnosis, read_cycles(folder), commissioning)


def total(table: Mapping[str, int], word: str) -> int:
    """Cycles of a label, settled or not."""
    return sum(count for key, count in table.items() if key.startswith(word))


def form(result: Score) -> dict[str, Any]:
    """Machine form: whole cycles of unseen blocks, as the README counts them."""
    off, found = result.off_profile, {"healthy alarmed": ("none", result.alarmed)}
    found |= {f"{word} found": (word, result.leak_named) for word in ("weak", "severe")}
    return {
        **{
            name: Share(total(table, word), total(result.cycles, word)).form()
            for name, (word, table) in found.items()
        },
        "off profile unknown": Share(off["cycles with unknown"], off["cycles"]).form(),
        "off profile named": Share(off["seconds with a fault named"], off["seconds"]).form(),
    }


if __name__ == "__main__":
    measured = {law: form(run(recordings_folder() / "zema-hydraulic", law)) for law in PLANTS}
    print(json.dumps(measured, indent=1))
