"""The fault-symptom matrix as a table, with groups of faults that are alike."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

from rulec_runtime.contract.degree import smallest_degree
from rulec_runtime.contract.ruleset import AmbiguousGroup, FaultSpec, ResidualSpec, Ruleset
from rulec_runtime.contract.ruleset import Cell as FaultCell
from rulec_runtime.report.parts import Cell, Content, Facts, Table, Words, html
from rulec_runtime.report.text import Html, safe
from rulec_runtime.report.wording import STATUS

if TYPE_CHECKING:  # the matrix of a plant needs nothing that judges recordings
    from rulec_runtime.diagnosis.diagnose import Diagnosis

LARGEST = 600
"""Most cells shown; a larger matrix is cut to rows and columns that concern the findings."""

KINDS = {
    "coincide": ("=", "cannot be told apart", "same proportions in all residuals"),
    "nested": ("⊂", "hard to tell apart", "one signature is part of the other"),
    "close": ("≈", "alike at small degrees", "the difference hides in the noise"),
}
"""Sign, meaning and reason of each kind of group of faults that are alike."""

ANY_ERROR = "any error of this reading, whether its module lists it or not"
"""Meaning of the row of a reading."""


@dataclass(frozen=True)
class Named:
    """Faults that a diagnosis found, and their alternatives."""

    found: frozenset[str] = frozenset()
    possible: frozenset[str] = frozenset()


Groups = Sequence[tuple[str, AmbiguousGroup]]
"""Groups of faults that are alike, each with its mark."""


def matrix(diagnosis: Diagnosis) -> list[Content]:
    """The matrix with the findings of a diagnosis."""
    found = frozenset(f.fault.id for f in diagnosis.findings)
    possible = frozenset(name for f in diagnosis.findings for name, _ in f.alternatives)
    return matrix_of(diagnosis.ruleset, Named(found, possible - found))


def matrix_of(ruleset: Ruleset, named: Named, whole: bool = False) -> list[Content]:
    """The matrix for a page; a column marks groups of faults that are alike, which are explained
    below it."""
    faults, residuals, part = _chosen(ruleset, named, whole)
    ids = {f.id for f in faults}
    groups = [(m, g) for m, g in marked(ruleset) if ids & set(g.faults)]
    key = (
        "+ rises, − falls, · no effect; below: smallest degree beyond the threshold at the "
        "reference point"
    )
    key += f"; ± {ANY_ERROR}" if ruleset.unlisted else ""
    key += "; bold rows: diagnosed here" if named.found else ""
    key += "; dashed rows: could also be" if named.possible else ""
    key += "; alike: see below" if groups else ""
    both = named.found | named.possible
    near = [(m, g) for m, g in groups if whole or both & set(g.faults)]
    far = [pair for pair in groups if pair not in near]
    title = "Other faults that are alike" if near else "Faults that are alike"
    folded = f"<details><summary>{title}</summary>{alike(far)}</details>" if far else ""
    return [
        *(Words(text, soft=True) for text in (key, part) if text),
        matrix_table(ruleset, faults, residuals, named, groups),
        Html(alike(near) + folded),
    ]


def matrix_table(
    ruleset: Ruleset,
    faults: Sequence[FaultSpec],
    residuals: Sequence[ResidualSpec],
    named: Named,
    groups: Groups = (),
) -> Table:
    """Rows are faults, then readings for all their unlisted errors; columns are residuals. Below
    each sign is the smallest detectable degree."""
    rows: list[list[Any]] = []
    for fault in faults:
        cells = {c.residual: c for c in ruleset.cells_of_fault[fault.id]}
        own = " ".join(_sign(m) for m, g in groups if fault.id in g.faults)
        signs = (_signed(fault, cells.get(r.id)) for r in residuals)
        rows.append([_first(fault.id, (fault,), named), Html(own), *signs])
    modules = {fault.module for fault in faults}
    for signal, moved in ruleset.moved_by_reading.items():
        if len(faults) == len(ruleset.faults) or signal.partition(".")[0] in modules:
            errors = [f for f in ruleset.unlisted if signal in f.scales]
            signs = ("±" if r.id in moved else "·" for r in residuals)
            rows.append([_first(signal, errors, named), "", *signs])
    names = [narrow(r.id) for r in residuals]
    titles = ["fault", "alike", *(f":{name}" for name in names)]
    if not groups:
        titles, rows = [titles[0], *titles[2:]], [[row[0], *row[2:]] for row in rows]
    return Table(titles, rows, "fault-symptom matrix", names, "matrix")


def narrow(residual: str) -> str:
    """The name of a residual in several lines, as columns are narrow.

    >>> narrow("A.pump-plant").split()
    ['A', 'pump-', 'plant']
    """
    module, _, name = residual.partition(".")
    return module + "\n" + name.replace("-", "-\n")


def _signed(fault: FaultSpec, cell: FaultCell | None) -> str | tuple[str, str]:
    if cell is None:
        return "·"
    return "+" if cell.sign > 0 else "-", smallest_degree(fault, cell.detectable)


def _first(title: str, faults: Iterable[FaultSpec], named: Named) -> str | Cell:
    """The first cell of a row, with the style and note of the first of its faults that a diagnosis
    names."""
    for fault in faults:
        if fault.id in named.found:
            note = f"{STATUS[fault.status][0]} diagnosed"
            return Cell((title, note), f"found is-{fault.status}")
        if fault.id in named.possible:
            return Cell((title, "could also be"), f"possible is-{fault.status}")
    return title


def marked(ruleset: Ruleset) -> Groups:
    """Groups of faults that are alike, each with the sign of its kind and a letter."""
    letters = (*ascii_lowercase, *map("".join, product(ascii_lowercase, repeat=2)))
    return [
        (f"{KINDS.get(group.kind, ('~', '', ''))[0]}{letter}", group)
        for letter, group in zip(letters, ruleset.ambiguous, strict=False)
    ]


def _sign(mark: str) -> str:
    return f'<b class="alike">{safe(mark)}</b>'


def alike(groups: Groups) -> str:
    """Groups by kind, with advice on how to tell their faults apart."""
    parts = []
    for kind, (sign, words, why) in KINDS.items():
        rows = [
            (Html(f"{_sign(mark)} {safe(' / '.join(group.faults))}"), [group.advice])
            for mark, group in groups
            if group.kind == kind
        ]
        if rows:
            parts.append(f'<h3 class="after">{safe(f"{sign} {words}: {why}")}</h3>')
            parts.append(html(Facts(rows, "remarks")))
    return "".join(parts)


def _chosen(
    ruleset: Ruleset, named: Named, whole: bool
) -> tuple[tuple[FaultSpec, ...], tuple[ResidualSpec, ...], str]:
    """Faults and residuals to show, and a remark if some are left out."""
    if whole or len(ruleset.faults) * len(ruleset.residuals) <= LARGEST:
        return ruleset.faults, ruleset.residuals, ""
    both = named.found | named.possible
    modules = {f.module for f in ruleset.faults if f.id in named.found}
    modules = modules or {next(iter(ruleset.modules))}
    faults = [f for f in ruleset.faults if f.id in both]
    faults += [f for f in ruleset.faults if f.module in modules and f.id not in both]
    moved = {c.residual for f in faults for c in ruleset.cells_of_fault[f.id]}
    residuals = [r for r in ruleset.residuals if r.id in moved]
    residuals.sort(key=lambda r: r.module not in modules)
    columns = max(1, min(len(residuals), 15))
    rows = max(1, LARGEST // columns)
    shown = tuple(faults[:rows]), tuple(residuals[:columns])
    part = (
        f"{len(shown[0])} of {len(ruleset.faults)} faults and {len(shown[1])} of "
        f"{len(ruleset.residuals)} residuals are shown; rulec matrix shows all"
    )
    return *shown, part
