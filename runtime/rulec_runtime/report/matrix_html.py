"""Write the fault-symptom matrix as an HTML table, with groups of faults that are alike."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from string import ascii_lowercase
from typing import TYPE_CHECKING

from rulec_runtime.contract.degree import smallest_degree
from rulec_runtime.contract.ruleset import AmbiguousGroup, Cell, FaultSpec, ResidualSpec, Ruleset
from rulec_runtime.report.parts import Drawing, framed
from rulec_runtime.report.text import safe
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


def matrix(diagnosis: Diagnosis) -> Drawing:
    """The matrix with the findings of a diagnosis."""
    found = frozenset(f.fault.id for f in diagnosis.findings)
    possible = frozenset(name for f in diagnosis.findings for name, _ in f.alternatives)
    return matrix_of(diagnosis.ruleset, Named(found, possible - found))


def matrix_of(ruleset: Ruleset, named: Named, whole: bool = False) -> Drawing:
    """Rows are faults, columns residuals; below each sign is the smallest detectable degree.

    A column marks groups of faults that are alike; they are explained below the matrix.
    """
    faults, residuals, part = _chosen(ruleset, named, whole)
    ids = {f.id for f in faults}
    groups = [(m, g) for m, g in marked(ruleset) if ids & set(g.faults)]
    head = '<th scope="col">alike</th>' if groups else ""
    for residual in residuals:
        # A residual's name takes several lines, since columns are narrow.
        module, _, rest = residual.id.partition(".")
        parts = (module, *rest.replace("-", "-\n").split("\n"))
        head += f'<th scope="col">{"<br/>".join(safe(part) for part in parts)}</th>'
    body = "".join(_row(ruleset, fault, residuals, named, groups) for fault in faults)
    modules = {fault.module for fault in faults}
    for signal in ruleset.moved_by_reading:
        if signal.partition(".")[0] in modules:
            body += _error_row(ruleset, signal, residuals, named, bool(groups))
    note = f'<p class="key">{safe(part)}</p>' if part else ""
    key = (
        "+ rises, − falls, · no effect; below: smallest degree beyond the threshold at the "
        "reference point"
    )
    key += f"; ± {ANY_ERROR}" if ruleset.unlisted else ""
    key += "; bold rows: diagnosed here" if named.found else ""
    key += "; dashed rows: could also be" if named.possible else ""
    key += "; alike: see below" if groups else ""
    shown = framed(
        "fault-symptom matrix",
        f'<table class="matrix"><thead><tr><th scope="col">fault</th>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table>",
    )
    both = named.found | named.possible
    near = [(m, g) for m, g in groups if whole or both & set(g.faults)]
    far = [pair for pair in groups if pair not in near]
    title = "Other faults that are alike" if near else "Faults that are alike"
    folded = f"<details><summary>{title}</summary>{told_alike(far)}</details>" if far else ""
    return Drawing(f'<p class="key">{key}</p>{note}{shown}{told_alike(near)}{folded}')


def marked(ruleset: Ruleset) -> Groups:
    """Groups of faults that are alike, each with the sign of its kind and a letter."""
    letters = (*ascii_lowercase, *map("".join, product(ascii_lowercase, repeat=2)))
    return [
        (f"{KINDS.get(group.kind, ('~', '', ''))[0]}{letter}", group)
        for letter, group in zip(letters, ruleset.ambiguous, strict=False)
    ]


def told_alike(groups: Groups) -> str:
    """Groups by kind, with advice on how to tell their faults apart."""
    parts = []
    for kind, (sign, words, why) in KINDS.items():
        own = [(m, g) for m, g in groups if g.kind == kind]
        if own:
            rows = "".join(
                f'<dt><b class="alike">{safe(m)}</b> {safe(" / ".join(g.faults))}</dt>'
                f"<dd>{safe(g.advice)}</dd>"
                for m, g in own
            )
            parts.append(f'<h3 class="after">{safe(f"{sign} {words}: {why}")}</h3>')
            parts.append(f'<dl class="remarks">{rows}</dl>')
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


def _row(
    ruleset: Ruleset,
    fault: FaultSpec,
    residuals: Collection[ResidualSpec],
    named: Named,
    groups: Groups,
) -> str:
    known: Mapping[str, Cell] = {c.residual: c for c in ruleset.cells_of_fault[fault.id]}
    own = " ".join(f'<b class="alike">{safe(m)}</b>' for m, g in groups if fault.id in g.faults)
    cells = f'<td class="kin">{own}</td>' if groups else ""
    for residual in residuals:
        if (cell := known.get(residual.id)) is None:
            cells += '<td class="soft">·</td>'
        else:
            degree = safe(smallest_degree(fault, cell.detectable, "over "))
            cells += f"<td><b>{'+' if cell.sign > 0 else '−'}</b><small>{degree}</small></td>"
    return _as_row(fault.id, cells, (fault,), named)


def _error_row(
    ruleset: Ruleset, signal: str, residuals: Collection[ResidualSpec], named: Named, alike: bool
) -> str:
    """The row of a reading, for all its unlisted errors."""
    moved = ruleset.moved_by_reading[signal]
    cells = '<td class="kin"></td>' if alike else ""
    cells += "".join(
        "<td><b>±</b></td>" if r.id in moved else '<td class="soft">·</td>' for r in residuals
    )
    return _as_row(signal, cells, [f for f in ruleset.unlisted if signal in f.scales], named)


def _as_row(title: str, cells: str, faults: Iterable[FaultSpec], named: Named) -> str:
    """A row with the style and note of the first of its faults that a diagnosis names."""
    style = note = ""
    for fault in faults:
        if fault.id in named.found or fault.id in named.possible:
            found = fault.id in named.found
            style = f' class="{"found" if found else "possible"} is-{fault.status}"'
            words = f"{STATUS[fault.status][0]} diagnosed" if found else "could also be"
            note = f"<small>{words}</small>"
            break
    return f'<tr{style}><th scope="row">{safe(title)}{note}</th>{cells}</tr>'
