"""Degrees of every pump of the waste-water station in every sample, by the compiled rules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.diagnosis.steady.observe import observe, plan_inputs
from rulec_runtime.diagnosis.steady.points import Points, points_of_samples
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

from tests.conftest import compiled
from tests.rig.ranking import Array, medians

PLANT = "hsy-pumping"
FILE = Path("hsy-wastewater-pumping") / "hsy_15min.csv"
SMALL, LARGE = ("P11", "P21"), ("P12", "P13", "P14", "P22", "P23", "P24")
PUMPS = tuple(sorted(SMALL + LARGE))
RESIDUAL = {"missing-head": "pump-flow", "excess-power": "power-flow"}
DAYS, HALF = 16, 8
FEWEST = 3
"""Samples on which a degree must rest."""

HOUR = 4
LONG = 24
"""Samples of an hour, and of a run that is long (6 h)."""

M3_PER_H = 1 / 3600


@dataclass(frozen=True)
class Degrees:
    """Degrees of one fault, shape (pumps, samples); NaN where not judged.

    Negative degrees: better than the sheet. `u` is the standard uncertainty, nearly all of it
    the tolerance of the sheet and the unknown losses, which stay the same from day to day.
    """

    value: Array
    u: Array
    day: NDArray[np.intp]

    def of_days(self, first: int, last: int) -> Array:
        """Median degree of each pump over days `first` to `last` (excluded)."""
        chosen = (self.day >= first) & (self.day < last)
        return medians(self.value[:, chosen], FEWEST)

    def daily(self) -> Array:
        """Median degree per pump and day, shape (pumps, days)."""
        return np.stack([self.of_days(d, d + 1) for d in range(DAYS)], axis=1)

    def daily_u(self) -> Array:
        """Median standard uncertainty per pump and day; it does not average out over a day."""
        judged = np.where(np.isfinite(self.value), self.u, np.nan)
        return np.stack([medians(judged[:, self.day == d], FEWEST) for d in range(DAYS)], axis=1)

    def only(self, samples: NDArray[np.bool_]) -> Degrees:
        """Blank all but some samples, shape (pumps, samples)."""
        return replace(self, value=np.where(samples, self.value, np.nan))


@dataclass(frozen=True)
class Station:
    """The recording; degrees of every sample, and which samples lie in settled stretches."""

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

    def judged_above(self, level: float, fault: str) -> Degrees:
        """Degrees in settled stretches while the tunnel is at least this full (m)."""
        full = self.recording.values["channel.l"] >= level
        return self.judged(fault).only(np.broadcast_to(full, (len(PUMPS), len(full))))

    def fresh(self, fault: str) -> Degrees:
        """Degrees in the first hour after a start, without its first quarter."""
        chosen = np.zeros((len(PUMPS), len(self.settled)), dtype=bool)
        for row, pump in enumerate(PUMPS):
            for start, stop in self.runs(pump):
                chosen[row, start + 1 : min(start + 1 + HOUR, stop - 1)] = True
        return self.every[fault].only(chosen)


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
