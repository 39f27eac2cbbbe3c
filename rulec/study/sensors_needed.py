"""What each sensor is needed for: faults that cannot be detected, or told apart, without it."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.detectable_faults import VisiblePart, visible_of
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.blindness import named
from rulec_runtime.report.parts import Table, shown
from rulec_runtime.report.text import listed

from rulec.limits import SAME_DIRECTION

Without = Mapping[str, Mapping[str, Any]]


def without_each(ruleset: Ruleset) -> Without:
    """JSON data per signal that something reads: `unseen` are faults that cannot be detected
    without it, `merged` are groups of other listed faults that cannot be told apart without it and
    can with it, at one operating point."""
    visible = visible_of(ruleset)
    listed_ones = {f.id for f in ruleset.faults}
    every = [_alike(one, frozenset()) for one in visible.parts]
    found = {}
    for signal in (s.id for s in ruleset.signals if s.id in ruleset.read):
        lost = frozenset((signal,))
        unseen = visible.unseen(lost)
        merged = [
            group
            for one, before in zip(visible.parts, every, strict=True)
            if signal in one.signals
            for group in _merged(_alike(one, lost), before, one, listed_ones)
        ]
        found[signal] = {
            "unseen": [f.id for f in ruleset.faults if f.id in unseen],
            "merged": merged,
        }
    return found


def _merged(
    now: np.ndarray, before: np.ndarray, one: VisiblePart, listed_ones: set[str]
) -> Iterator[list[str]]:
    """Groups of listed faults of a part that are alike now and were not all alike before; `now` and
    `before` flag pairs of all its faults, shape (faults, faults)."""
    from scipy.sparse.csgraph import connected_components  # slow to load

    faults = list(one.highest)
    chosen = np.array([name in listed_ones for name in faults], dtype=bool)
    now = now & np.outer(chosen, chosen)
    group = connected_components(now)[1]
    for number in np.unique(group[(now & ~before).any(axis=0)]):
        yield [faults[i] for i in np.flatnonzero(group == number)]


def _alike(one: VisiblePart, lost: frozenset[str]) -> np.ndarray:
    """Flags of faults of a part that move the remaining readings in the same proportion, shape
    (faults, faults)."""
    products = one.information(lost)
    size = np.sqrt(np.diag(products))
    scale = np.where(size > 0.0, size, np.inf)
    with np.errstate(invalid="ignore"):
        same: np.ndarray = products / np.outer(scale, scale) > SAME_DIRECTION
    np.fill_diagonal(same, False)
    return same


def show_without(out: Console, ruleset: Ruleset, without: Without) -> None:
    """Print a table with a row per sensor."""
    rows, broken = [], ("cannot be seen", "cannot be told apart")
    for signal, lost in without.items():
        unseen = listed(list(named(ruleset, lost["unseen"])))
        merged = "; ".join(listed(group) for group in lost["merged"])
        rows.append((signal, unseen or "-", merged or "-"))
    out.print(styled("\n[bold]What each sensor is needed for[/], at the reference point"))
    out.print(shown(Table(("without", *broken), rows, broken=broken)))
