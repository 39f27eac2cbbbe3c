"""What was asked for, beside what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tests.rig.mixing_rig.judge import Judged
from tests.rig.mixing_rig.measure import (
    alarm_figures,
    degree_figures,
    grouped,
    isolation_figures,
    sample_figures,
)

PAPER_LEAKAGE, PAPER_ALL = 0.029, 0.12  # mean |discrepancy|; Wetterich 2025, section 4
LITERATURE = {0.1: 0.79, 0.2: 0.90, 0.3: 0.94}
"""Share isolated with known models, abc, one operating point. Source: method.md, section 2."""


@dataclass(frozen=True)
class Goal:
    """A figure that should lie between two others."""

    what: str
    low: float
    high: float
    measured: float

    @property
    def met(self) -> bool:
        """Whether it does; not if nothing was measured."""
        return self.low <= self.measured <= self.high


def leakage_goals(judged: Judged) -> list[Goal]:
    """Goals for each plant, samples judged alone in default mode."""
    goals = []
    for group in dict.fromkeys(s.group for s in judged.samples):
        parts = [s for s in judged.samples if (s.group, s.mode) == (group, "default")]
        found = sample_figures(parts, "A.leakage")
        what = f"leakage in A, {group}"
        goals += [
            Goal(f"{what}: mean |error| (paper {PAPER_LEAKAGE})", 0.0, 0.010, found.error),
            Goal(f"{what}: bias", -0.005, 0.005, found.bias),
            Goal(f"{what}: truth inside the 95 % bounds", 0.93, 0.97, found.covered),
        ]
    return goals


def degree_goals(judged: Judged) -> list[Goal]:
    """Goals for all faults."""
    found = degree_figures([a for a in judged.answers if a.mode == "default"])
    what = "all faults, rightly named"
    return [
        Goal("stationary points", 1200, float("inf"), found.points),
        Goal(f"{what}: mean |discrepancy| (paper {PAPER_ALL})", 0.0, 0.03, found.error),
        Goal(f"{what}: truth inside the 95 % bounds", 0.93, 0.97, found.covered),
    ]


def isolation_goals(judged: Judged) -> list[Goal]:
    """Goals for the plant abc at one operating point, by degree."""
    one_point = [a for a in judged.answers if a.group == "abc, 1 operating point"]
    groups = grouped(one_point, lambda a: f"{a.set_degree:g}")
    return [
        Goal(
            f"abc, one operating point, degree {degree}: named first",
            LITERATURE.get(float(degree), 0.0),
            1.0,
            isolation_figures(part).first,
        )
        for degree, part in groups.items()
    ]


def alarm_goals(judged: Judged) -> list[Goal]:
    """No false alarm, neither from findings nor from samples judged alone."""
    covered = [c for c in judged.covered if c.mode == "default"]
    found = alarm_figures(covered, [s for s in judged.samples if s.mode == "default"])
    return [
        Goal("fault-free samples", 100_000, float("inf"), found.samples),
        Goal("fault-free samples in a finding", 0, 0, found.fault),
        Goal("fault-free samples, judged alone, with a fault", 0, 0, found.alone_fault),
    ]


GOALS: Mapping[str, Callable[[Judged], list[Goal]]] = {
    "leakage": leakage_goals,
    "degrees": degree_goals,
    "isolation": isolation_goals,
    "alarms": alarm_goals,
}
