"""Waste-water pumping station: each pump against its data sheet, day by day; no labels exist.

Nothing of the recording enters the degrees: curves and tolerances come from the maker's sheets,
losses from the ordered duty points. What is fitted (`by_halves`: head and power of each pump, by
`rulec calibrate`) is fitted on the first and on the last eight days apart, and the two compared.
The smallest level at which a pump is judged (1.2 m) was set after a look at all days.

Run ``python -m tests.rig.hsy`` for the figures, with ``--json -`` for their machine form.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import sys
import tempfile
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rulec.cli import main
from tests.conftest import ROOT, recordings_folder
from tests.figures.share import Share
from tests.rig.ranking import Array, Order, medians, order, same_order
from tests.rig.station import (
    DAYS,
    FEWEST,
    FILE,
    HALF,
    HOUR,
    LARGE,
    LONG,
    M3_PER_H,
    PLANT,
    PUMPS,
    SMALL,
    Degrees,
    Station,
    judge,
)


def beyond_the_sheet(degrees: Degrees) -> dict[str, tuple[int, int]]:
    """Per pump: days on which the lower 95 % bound is above 0, and days judged."""
    degree, u = degrees.daily(), degrees.daily_u()
    with np.errstate(invalid="ignore"):
        beyond = (degree - 2 * u > 0).sum(axis=1)
    judged = np.isfinite(degree).sum(axis=1)
    return {p: (int(b), int(n)) for p, b, n in zip(PUMPS, beyond, judged, strict=True)}


def halves(degrees: Degrees, pumps: tuple[str, ...] = PUMPS) -> Order:
    """Ranking of the first against the last eight days."""
    rows = [PUMPS.index(p) for p in pumps]
    first, last = degrees.of_days(0, HALF), degrees.of_days(HALF, DAYS)
    return order(first[rows], last[rows], pumps)


def day_to_day(degrees: Degrees, pumps: tuple[str, ...] = PUMPS) -> tuple[int, int]:
    """Pairs of pumps in the same order on two days following, and pairs compared."""
    return same_order(degrees.daily()[[PUMPS.index(p) for p in pumps]])


def while_running(station: Station, fault: str) -> tuple[list[float], list[float]]:
    """Change of a degree over each long run (first to last hour), and over the stop after it.

    The first and the last quarter hour of a run are left out; a stop counts up to a day.
    """
    grown, fallen = [], []
    for row, pump in enumerate(PUMPS):
        degree, runs = station.every[fault].value[row], station.runs(pump)
        for (start, stop), then in zip_longest(runs, runs[1:]):
            first, last = (
                _hour(degree[start + 1 : stop - 1], 0),
                _hour(degree[start + 1 : stop - 1]),
            )
            if stop - start < LONG or not np.isfinite(last):
                continue
            grown.append(last - first)
            if then is not None and then[0] - stop <= 24 * HOUR:
                fallen.append(_hour(degree[then[0] + 1 : then[1] - 1], 0) - last)
    return [x for x in grown if np.isfinite(x)], [x for x in fallen if np.isfinite(x)]


def _hour(part: Array, start: int = -HOUR) -> float:
    """Median of the first (0) or last hour; NaN where not judged."""
    return float(medians((part[:HOUR] if start == 0 else part[start:])[None], FEWEST)[0])


def common_losses(station: Station) -> tuple[float, float, int]:
    """Losses shared by all pumps (m/(m3/s)2), standard error, number of events.

    What a pump's missing head (in m) does when *another* pump starts or stops, against the square
    of the station's flow. In that half hour the pump itself does not change.
    """
    values = station.recording.values
    total, lift = values["channel.Q"], 30.0 - values["channel.l"]
    lost, rise = [], []
    for row, pump in enumerate(PUMPS):
        f, missing = values[f"{pump}.f"], station.every["missing-head"].value[row] * lift
        for a in range(1, len(f) - 3):
            b = a + 2
            window, quiet = slice(a - 1, b + 2), 200 * M3_PER_H
            steady = np.ptp(f[window]) < 0.3 and np.isfinite(missing[window]).all()
            calm = abs(total[a] - total[a - 1]) < quiet and abs(total[b + 1] - total[b]) < quiet
            if steady and calm and abs(total[b] - total[a]) > 800 * M3_PER_H:
                lost.append(missing[b] - missing[a])
                rise.append(total[b] ** 2 - total[a] ** 2)
    x, y = np.array(rise), np.array(lost)
    slope = float(x @ y / (x @ x))
    return slope, float(np.sqrt(np.mean((y - slope * x) ** 2) / (x @ x))), len(x)


def by_halves(folder: Path) -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """`rulec calibrate` on each half: head (c_H) and power (c_P) over the sheet's, per pump."""
    found: dict[str, tuple[dict[str, float], dict[str, float]]] = {"c_H": ({}, {}), "c_P": ({}, {})}
    with tempfile.TemporaryDirectory() as work:
        for half in (0, 1):
            part, target = Path(work) / "part.csv", Path(work) / "found.yaml"
            _write_half(folder / FILE, half, part)
            plant = ROOT / "plants" / PLANT
            with contextlib.redirect_stdout(io.StringIO()):
                assert 0 == main(["calibrate", str(plant), str(part), "-o", str(target), "--force"])
            modules = yaml.safe_load(target.read_text(encoding="utf-8"))["modules"]
            for name, sides in found.items():
                for pump, entry in modules.items():
                    sides[half][pump] = float(entry["parameters"][name]["value"])
    return found


def _write_half(source: Path, half: int, target: Path) -> None:
    """Copy the first or the last eight days."""
    with source.open(encoding="utf-8") as file, target.open("w", encoding="utf-8") as out:
        rows = csv.reader(file)
        writer = csv.writer(out)
        writer.writerow(next(rows))
        days: dict[str, None] = {}
        for row in rows:
            days.setdefault(row[0][:10])
            if (len(days) > HALF) == bool(half):
                writer.writerow(row)


def show(folder: Path) -> None:
    """Print the figures."""
    station = judge(folder)
    settled = int(station.settled.sum())
    print(f"{len(station.settled)} samples, {settled} in {station.stretches} settled stretches")
    for fault in station.every:
        judged = station.judged(fault)
        print(f"{fault} in per cent, median of a day +- 95 % (samples)")
        for row, pump in enumerate(PUMPS):
            runs = int(station.running(pump).sum())
            beyond, days = beyond_the_sheet(judged)[pump]
            print(
                f"  {pump}: runs in {runs} samples, judged {_count(judged.value[row])}; "
                f"lower bound above 0 on {beyond} of {days} days"
            )
            print("    " + (_days(judged, row) or "never ran; nothing can be said"))
        for name, degrees in (("settled", judged), ("first hour of a run", station.fresh(fault))):
            for kind, pumps in (("all", PUMPS), ("large", LARGE), ("small", SMALL)):
                found, (same, total) = halves(degrees, pumps), day_to_day(degrees, pumps)
                print(
                    f"  {name}, {kind} ({', '.join(found.names)}): first against last 8 days "
                    f"Spearman {found.spearman:.2f}, Kendall {found.kendall:.2f} "
                    f"(p {found.p:.3f}); day to day {same} of {total} pairs in the same order"
                )
        for level in (1.5, 1.8):
            kendall = halves(station.judged_above(level, fault)).kendall
            print(f"  judged only above {level} m, all: Kendall {kendall:.2f}")
        for name, changes in zip(
            ("over a run of 6 h or more", "over the stop after it"),
            while_running(station, fault),
            strict=True,
        ):
            rises, error = int(np.sum(np.array(changes) > 0)), np.std(changes) / len(changes) ** 0.5
            print(
                f"  change {name}: {100 * np.mean(changes):+.1f} +- {200 * error:.1f} %, "
                f"a rise in {rises} of {len(changes)}"
            )
    slope, error, count = common_losses(station)
    print(f"losses common to all pumps: {slope:.3f} +- {2 * error:.3f} m/(m3/s)2, {count} events")
    for name, (first, last) in by_halves(folder).items():
        values = ", ".join(f"{p} {first[p]:.3f} / {last[p]:.3f}" for p in first if p in last)
        print(f"{name} by rulec calibrate, first / last 8 days: {values}")


def _count(values: Array) -> int:
    return int(np.isfinite(values).sum())


def _days(degrees: Degrees, row: int) -> str:
    """One cell per day judged: date, degree, half width, samples."""
    cells = []
    for day, degree in enumerate(degrees.daily()[row]):
        here = degrees.day == day
        if np.isfinite(degree):
            u = np.nanmedian(
                np.where(np.isfinite(degrees.value[row]), degrees.u[row], np.nan)[here]
            )
            number = _count(degrees.value[row][here])
            cells.append(f"Nov {15 + day}: {100 * degree:.1f}+-{200 * u:.1f} ({number})")
    return ", ".join(cells)


def form(folder: Path) -> dict[str, Any]:
    """Machine form of the figures that the docs print."""
    station = judge(folder)
    slope, error, events = common_losses(station)
    power = beyond_the_sheet(station.judged("excess-power"))
    found: dict[str, Any] = {
        "samples": len(station.settled),
        "settled": int(station.settled.sum()),
        "days beyond the sheet": {pump: list(days) for pump, days in power.items()},
        "common losses": {"slope": slope, "U": 2 * error, "events": events},
    }
    for fault in station.every:
        judged = station.judged(fault)
        grown, fallen = while_running(station, fault)
        found[fault] = {
            "kendall": halves(judged).kendall,
            "kendall above 1.5 m": halves(station.judged_above(1.5, fault)).kendall,
            "kendall above 1.8 m": halves(station.judged_above(1.8, fault)).kendall,
            "day to day": Share(*day_to_day(judged)).form(),
            "first hour": Share(*day_to_day(station.fresh(fault))).form(),
            "over a run": float(np.mean(grown)),
            "over a stop": float(np.mean(fallen)),
        }
    return found


if __name__ == "__main__":
    if sys.argv[1:] == ["--json", "-"]:
        print(json.dumps(form(recordings_folder()), indent=1))
    else:
        show(recordings_folder())
