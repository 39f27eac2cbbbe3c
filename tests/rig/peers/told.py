"""Peers beside ours in the terminal and as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.text import number, percent

from tests.rig.peers.judge import MODELS, NAMING, OURS, Judged
from tests.rig.peers.limits import NEAR_BEST

NOTE = (
    "Errors: root mean square of the reading that counts on rows that were never shown; adopted is "
    "ours; – does not apply. Names: shares of what is missing whose place, and whose name, is in "
    "what is told; false: names that are right for nothing."
)


def tell(out: Console, found: Sequence[Judged]) -> None:
    """Write the tables."""
    out.print(styled("[dim]{}[/]", NOTE))
    for title, headings, rows in parts(found):
        out.print(styled("\n[bold]{}[/]", title))
        shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for i, heading in enumerate(headings):
            shown.add_column(heading, justify="right" if i else "left", no_wrap=True)
        for row in rows:
            shown.add_row(*map(Text, row))  # a unit in brackets is no markup
        out.print(shown)


def parts(found: Sequence[Judged]) -> Iterator[tuple[str, Sequence[str], list[list[str]]]]:
    """Tables with title, headings and cells."""
    rows = [
        [j.rig, f"{j.signal} [{j.unit}]", *(_number(j.errors[m]) for m in MODELS)] for j in found
    ]
    yield "Errors on unseen rows", ("rig", "reading", *MODELS), rows
    methods = (OURS, *NAMING)
    headings = [f"{m} {score}" for m in methods for score in ("place", "name", "false")]
    rows = [
        [j.rig, *(cell for m in methods for cell in _names(j, m))] for j in found if j.names[OURS]
    ]
    yield "Names", ("rig", *headings), rows
    rows = [
        [
            j.rig,
            "–" if (w := j.where).right is None else percent(w.right),
            f"{w.told} of {w.places}",
        ]
        for j in found
        if j.where
    ]
    yield "Where, by structure alone (Fault Diagnosis Toolbox)", ("rig", "right", "places"), rows
    rows = [
        [s["model"], _number(s["over recalibrated"]), _number(s["ours there"]), str(s["rigs"])]
        for s in summary(found)["models"]
    ]
    headings = ["geometric mean of errors", "over recalibrated", "ours there", "rigs"]
    yield _headline(found), headings, rows


def summary(found: Sequence[Judged]) -> dict[str, Any]:
    """Rigs on which ours is best or near it, and geometric means over rigs that have a model."""
    models = []
    for model in MODELS[2:]:
        there = [j for j in found if j.errors[model] is not None]
        means = {"over recalibrated": _mean(there, model), "ours there": _mean(there, OURS)}
        models.append({"model": model, **means, "rigs": len(there)})
    return {"best": sum(_best(j, 1.0) for j in found), "near": sum(_best(j) for j in found)} | {
        "rigs": len(found),
        "models": models,
    }


def form(found: Sequence[Judged]) -> dict[str, Any]:
    """Machine form."""
    rigs = {j.rig: dataclasses.asdict(j) for j in found}
    return {"summary": summary(found), "rigs": rigs}


def _headline(found: Sequence[Judged]) -> str:
    s = summary(found)
    return (
        f"Ours is best on {s['best']} of {s['rigs']} rigs, within 10 % of the best on {s['near']}"
    )


def _best(j: Judged, near: float = NEAR_BEST) -> bool:
    ours = j.errors[OURS]
    return ours is not None and ours <= near * min(e for e in j.errors.values() if e is not None)


def _mean(found: Sequence[Judged], model: str) -> float | None:
    """Geometric mean of errors over those of recalibration."""
    pairs = [(j.errors[model], j.errors["recalibrated"]) for j in found]
    logs = [math.log(a / b) for a, b in pairs if a and b]
    return math.exp(sum(logs) / len(logs)) if logs else None


def _names(j: Judged, method: str) -> list[str]:
    named = j.names.get(method)
    if named is None:
        return ["–"] * 3
    shares = ["–" if s is None else percent(s) for s in (named.place, named.name)]
    return [*shares, str(named.false)]


def _number(value: float | None) -> str:
    return "–" if value is None else number(value, 3)
