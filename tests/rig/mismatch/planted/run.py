"""Judge all cases in worker processes, and print what came out."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.rig.mismatch.planted.cases import HEAVY, Planted, cases
from tests.rig.mismatch.planted.judge import Judged, judge

WORST = 10
EVERY = 20
"""Cases between two lines of progress."""


def run(out: Console, workers: int, quick: bool = False, kinds: Sequence[str] = ()) -> list[Judged]:
    """Judge and print; the order of the results is that of the cases."""
    begin = time.perf_counter()
    asked = cases(quick, kinds)
    judged = answers(out, asked, workers)
    show(out, judged)
    seconds = sum(j.seconds for j in judged)
    out.print(
        f"{len(judged)} cases, {time.perf_counter() - begin:.0f} s with {workers} processes "
        f"({seconds / max(len(judged), 1):.1f} s a case)"
    )
    return judged


def answers(out: Console, asked: Sequence[Planted], workers: int) -> list[Judged]:
    """Long cases first, so that all workers end together."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    order = sorted(range(len(asked)), key=lambda i: asked[i].plant != HEAVY)
    found: dict[int, Judged] = {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context) as pool:
        results = pool.map(judge, [asked[i] for i in order])
        for count, (i, result) in enumerate(zip(order, results, strict=True), 1):
            found[i] = result
            if count % EVERY == 0:
                out.print(f"{count} of {len(asked)}", style="dim")
    return [found[i] for i in range(len(asked))]


def show(out: Console, judged: Sequence[Judged]) -> None:
    """All tables."""
    _table(out, "by kind", judged, lambda j: j.case.kind)
    _table(out, "by plant", [j for j in judged if j.case.kind == "effect"], lambda j: j.case.plant)
    effects = [j for j in judged if j.case.kind == "effect"]
    _table(out, "by strength", effects, lambda j: j.case.strength)
    _table(out, "by sort", effects, lambda j: j.sorts[0])
    _table(out, "by effect", effects, lambda j: _short(j.case.planted[0]))
    _confused(out, judged)
    _worst(out, judged)
    _reliability(out, judged)
    clean = [j for j in judged if j.case.kind == "clean"]
    wrong = [j for j in clean if j.verdict != "none"]
    out.print(f"[bold]false claims on clean recordings[/]: {len(wrong)} of {len(clean)}")
    for j in wrong:
        out.print(f"  {j.case.name}: {_said(j)}", markup=False, highlight=False)
    for j in (j for j in judged if j.error):
        out.print(f"  failed: {j.case.name}: {j.error}", markup=False, highlight=False)


def _short(id_: str) -> str:
    return id_.partition(".")[2].partition("@")[0]


def _table(
    out: Console, title: str, judged: Sequence[Judged], key: Callable[[Judged], str]
) -> None:
    groups: dict[str, list[Judged]] = defaultdict(list)
    for j in judged:
        groups[key(j)].append(j)
    table = Table(title=title, box=None, padding=(0, 2), pad_edge=False, title_justify="left")
    columns = ("", "cases", "seen", "place", "name", "name seen", "verdict", "inside", "ratio",
               "false", "s")  # fmt: skip
    for column in columns:
        table.add_column(column, justify="left" if not column else "right")
    for name, group in groups.items():
        table.add_row(name, *_figures(group))
    if len(groups) > 1:
        table.add_row("all", *_figures(judged))
    out.print(table)
    out.print()


def _figures(group: Sequence[Judged]) -> list[str]:
    seen = [j for j in group if j.seen]
    inside = [i for j in group for i in j.inside]
    ratios = [j.ratio for j in group if np.isfinite(j.ratio)]
    return [
        str(len(group)),
        str(len(seen)),
        _share([j.place_right for j in group]),
        _share([j.name_right for j in group]),
        _share([j.name_right for j in seen]),
        _share([float(j.verdict == j.expected) for j in group]),
        f"{sum(inside)}/{len(inside)}",
        f"{np.median(ratios):.3f}" if ratios else "-",
        str(sum(j.false_names for j in group)),
        f"{np.mean([j.seconds for j in group]):.1f}",
    ]


def _share(values: Sequence[float]) -> str:
    return f"{100 * np.mean(values):.0f} %" if len(values) else "-"


def _said(j: Judged) -> str:
    parts = []
    for n in j.named:
        rivals = ", ".join(f"{i} {p:.2f}" for i, p in list(n.rivals.items())[:3])
        parts.append(f"{n.id} {n.probability:.2f}" + (f" ({rivals})" if rivals else ""))
    if j.hidden:
        parts.append(f"hidden at {j.hidden}")
    return f"{j.verdict}: " + ("; ".join(parts) or "nothing")


def _confused(out: Console, judged: Sequence[Judged]) -> None:
    """What was said instead, most frequent first."""
    pairs: Counter[tuple[str, str]] = Counter()
    for j in judged:
        if j.name_right == 1.0 or j.case.kind in ("two", "clean"):
            continue
        said = " + ".join(_short(n.id) for n in j.named) or (
            f"hidden ({j.verdict})" if j.hidden else f"nothing ({j.verdict})"
        )
        weak = "" if j.seen else " (not to be seen)"
        pairs[f"{j.case.kind}: {_short(j.case.planted[0])}{weak}", said] += 1
    out.print("[bold]said instead[/]")
    for (true, said), count in pairs.most_common():
        out.print(f"  {count}  {true} -> {said}", markup=False, highlight=False)
    out.print()


def _reliability(out: Console, judged: Sequence[Judged]) -> None:
    """How often the first name is right, by the probability it was given."""
    ends = (0.0, 0.6, 0.8, 0.95, 1.01)
    told = [(n.probability, n.id in j.case.planted) for j in judged for n in j.named]
    out.print("[bold]first name right, by its probability[/]")
    for low, high in itertools.pairwise(ends):
        part = [right for p, right in told if low <= p < high]
        if part:
            out.print(f"  {low:.2f} to {min(high, 1.0):.2f}: {sum(part)} of {len(part)}")
    out.print()


def _worst(out: Console, judged: Sequence[Judged]) -> None:
    """Wrong names where the truth leads most."""
    wrong = [j for j in judged if j.name_right < 0.5 and np.isfinite(j.lead)]
    wrong.sort(key=lambda j: -j.lead)
    out.print("[bold]worst cases[/] (lead of the true model in log likelihood)")
    for j in wrong[:WORST]:
        out.print(
            f"  {j.lead:8.1f} {j.case.name} (gain {j.gain:.1f}, over calibration {j.eased:.1f})"
            f" -> {_said(j)}",
            markup=False,
            highlight=False,
        )
    out.print()
