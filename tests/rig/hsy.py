"""Samples of the waste-water station that are settled, as JSON: `python -m tests.rig.hsy`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.observe import observe, plan_inputs
from rulec_runtime.diagnosis.steady.points import Points, points_of_samples
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

from tests.conftest import compiled, recordings_folder

PLANT = "hsy-pumping"
FILE = Path("hsy-wastewater-pumping") / "hsy_15min.csv"
PUMPS = ("P11", "P12", "P13", "P14", "P21", "P22", "P23", "P24")
RESIDUAL = {"missing-head": "pump-flow", "excess-power": "power-flow"}
DAYS = 16
FEWEST = 3
"""Samples on which a degree must rest."""

HOUR = 4
LONG = 24
"""Samples of an hour, and of a run that is long (6 h)."""


@dataclass(frozen=True)
class Degrees:
    """Degrees of one fault, shape (pumps, samples); NaN where not judged.

    Negative degrees: better than the sheet. `u` is the standard uncertainty, nearly all of it
    the tolerance of the sheet and the unknown losses, which stay the same from day to day.
    """

    value: Array
    u: Array
    day: NDArray[np.intp]

    def daily(self) -> Array:
        """Median degree per pump and day, shape (pumps, days)."""
        return self._by_day(self.value)

    def daily_u(self) -> Array:
        """Median standard uncertainty per pump and day; it does not average out over a day."""
        return self._by_day(np.where(np.isfinite(self.value), self.u, np.nan))

    def _by_day(self, values: Array) -> Array:
        return np.stack([medians(values[:, self.day == d]) for d in range(DAYS)], axis=1)

    def only(self, samples: NDArray[np.bool_]) -> Degrees:
        """Blank all but some samples, shape (pumps, samples)."""
        return replace(self, value=np.where(samples, self.value, np.nan))


@dataclass(frozen=True)
class Station:
    recording: Recording
    stretches: int
    settled: NDArray[np.bool_]
    every: Mapping[str, Degrees]

    def running(self, pump: str) -> NDArray[np.bool_]:
        """Samples in which a pump runs all 15 min."""
        minimum = compiled(PLANT).signal_by_id[f"{pump}.f"].minimum
        assert minimum is not None
        running: NDArray[np.bool_] = self.recording.values[f"{pump}.f"] >= minimum
        return running

    def runs(self, pump: str) -> list[tuple[int, int]]:
        """First and last (excluded) sample of each run of a pump."""
        padded = np.concatenate([[False], self.running(pump), [False]]).astype(int)
        return [(int(a), int(b)) for a, b in np.flatnonzero(np.diff(padded)).reshape(-1, 2)]

    def judged(self, fault: str) -> Degrees:
        """Degrees in settled stretches, as `rulec diagnose` sees them."""
        return self.every[fault].only(
            np.broadcast_to(self.settled, (len(PUMPS), len(self.settled)))
        )


def medians(values: Array) -> Array:
    """Median of each row over its finite entries, NaN where they are too few."""
    kept = [row[np.isfinite(row)] for row in values]
    return np.array([np.median(k) if len(k) >= FEWEST else np.nan for k in kept])


def beyond_the_sheet(degrees: Degrees) -> dict[str, tuple[int, int]]:
    """Per pump: days on which the lower 95 % bound is above 0, and days judged."""
    degree, u = degrees.daily(), degrees.daily_u()
    with np.errstate(invalid="ignore"):
        beyond = (degree - 2 * u > 0).sum(axis=1)
    judged = np.isfinite(degree).sum(axis=1)
    return {p: (int(b), int(n)) for p, b, n in zip(PUMPS, beyond, judged, strict=True)}


def while_running(station: Station, fault: str) -> tuple[list[float], list[float]]:
    """Change of a degree over each long run (first to last hour), and over the stop after it.

    The first and the last quarter hour of a run are left out; a stop counts up to a day.
    """
    grown, fallen = [], []
    for row, pump in enumerate(PUMPS):
        degree, runs = station.every[fault].value[row], station.runs(pump)
        for (start, stop), then in zip_longest(runs, runs[1:]):
            first, last = _ends(degree[start + 1 : stop - 1])
            if stop - start < LONG or not np.isfinite(last):
                continue
            grown.append(last - first)
            if then is not None and then[0] - stop <= 24 * HOUR:
                fallen.append(_ends(degree[then[0] + 1 : then[1] - 1])[0] - last)
    return [x for x in grown if np.isfinite(x)], [x for x in fallen if np.isfinite(x)]


def _ends(run: Array) -> tuple[float, float]:
    """Medians of the first and of the last hour of a run; NaN where not judged."""
    return float(medians(run[None, :HOUR])[0]), float(medians(run[None, -HOUR:])[0])


def judge(folder: Path) -> Station:
    """Degrees by the rules of the ruleset, each by a residual that the other fault leaves alone."""
    ruleset = compiled(PLANT)
    recording = read_recording(folder / FILE, ruleset)
    noise = noise_at_work(recording, ruleset)
    stretches = find_stretches(recording, ruleset, noise)
    settled = np.zeros(len(recording), dtype=bool)
    for first, last in zip(stretches.first, stretches.last, strict=True):
        settled[first:last] = True
    points = points_of_samples(recording, ruleset, noise)
    day = (recording.time // 86_400).astype(int)
    every = {fault: Degrees(*_rules(points, fault), day) for fault in RESIDUAL}
    return Station(recording, len(stretches), settled, every)


def _rules(points: Points, fault: str) -> tuple[Array, Array]:
    """Degree and standard uncertainty per pump and point; NaN where an estimate is unusable."""
    ruleset = compiled(PLANT)
    keys = [f"{pump}.{fault}:{pump}.{RESIDUAL[fault]}" for pump in PUMPS]
    forms = ("x:exact", "ux:linear")
    out = ruleset.plan.select([f"{form}:{key}" for key in keys for form in forms]).run(
        plan_inputs(points)
    )
    valid = observe(ruleset, points).valid
    row = {o.id: i for i, o in enumerate(ruleset.observers)}
    value, u = [], []
    for pump, key in zip(PUMPS, keys, strict=True):
        # Where the level is too low for the head, air may spoil the power as well.
        usable = np.all(
            [valid[row[f"{pump}.{part}"]] for part in ("flow", "pump", "power")], axis=0
        )
        value.append(np.where(usable, out[f"x:exact:{key}"], np.nan))
        u.append(np.where(usable, out[f"ux:linear:{key}"], np.nan))
    return np.array(value), np.array(u)


if __name__ == "__main__":
    settled = judge(recordings_folder()).settled
    print(json.dumps({"samples": len(settled), "settled": int(settled.sum())}))
