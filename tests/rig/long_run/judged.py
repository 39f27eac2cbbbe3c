"""What is right, as data, and what an answer lacks of it, in words."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from tests.rig.long_run.plants import Form

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
    told: Mapping[str, Any] = finding.get("now") or finding
    return float(told["degree"]), float(told["lower"]), float(told["upper"])


def width_of(finding: Form) -> float:
    _, lower, upper = now_of(finding)
    return (upper - lower) / 2.0


def within(told: tuple[float, float, float], degree: float) -> bool:
    """Is a degree close to the true one, or do its bounds hold it?"""
    said, lower, upper = told
    return abs(said - degree) <= CLOSE * degree or lower <= degree <= upper


def complaints(right: Right, form: Form) -> list[str]:
    found = [*_faults(right, form), *_sensors(right, form), *_blind(right, form)]
    for pattern in right.states:
        told = [*form["findings"], *form["regimes"]]
        if not any(re.search(pattern, _words(f), re.IGNORECASE) for f in told):
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
        if not within(now_of(finding), degree):
            said, lower, upper = now_of(finding)
            yield f"{fault} is {degree:.3g}, told {said:.3g} ({lower:.3g} to {upper:.3g})"
        if right.grows and "now" not in finding:
            yield f"{fault}: no course is told"
        if right.grows and width_of(finding) > USEFUL * degree:
            yield f"{fault}: {degree:.3g} is told within {width_of(finding):.2g} only"
        if right.events is not None:
            yield from _events(right.events, finding, form)


def _events(true: tuple[int, float], finding: Form, form: Form) -> Iterator[str]:
    told = finding.get("events")
    if told is None:
        yield "events are not counted"
        return
    count, duration = float(told["count"]), float(told["duration"])
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


def told(form: Form) -> str:
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
