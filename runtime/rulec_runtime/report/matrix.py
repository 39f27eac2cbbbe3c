"""The fault-symptom matrix as an HTML table, the rows of the findings standing out."""

from __future__ import annotations

from rulec_runtime.contract.degree import smallest_degree
from rulec_runtime.contract.ruleset import Cell, FaultSpec, ResidualSpec
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.report.text import safe

LARGEST = 600
"""Cells shown; of a larger matrix only rows and columns that concern the findings."""


def matrix(diagnosis: Diagnosis) -> str:
    """Rows are faults, columns residuals; below each sign the smallest detectable degree."""
    faults, residuals, part = _chosen(diagnosis)
    found = {f.fault.id for f in diagnosis.findings}
    head = "".join(f'<th scope="col">{_broken(r.id)}</th>' for r in residuals)
    body = "".join(_row(diagnosis, fault, residuals, fault.id in found) for fault in faults)
    note = f'<p class="key">{safe(part)}</p>' if part else ""
    return (
        '<p class="key">+ rises, − falls, · no effect; below: smallest degree beyond the threshold'
        f' at the reference point; bold rows: diagnosed here</p>{note}<div class="scroll">'
        f'<table class="matrix"><thead><tr><th></th>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _chosen(diagnosis: Diagnosis) -> tuple[tuple[FaultSpec, ...], tuple[ResidualSpec, ...], str]:
    """Faults and residuals to show, and a remark if that is not all."""
    ruleset = diagnosis.ruleset
    if len(ruleset.faults) * len(ruleset.residuals) <= LARGEST:
        return ruleset.faults, ruleset.residuals, ""
    named = {f.fault.id for f in diagnosis.findings}
    named |= {name for f in diagnosis.findings for name, _ in f.alternatives}
    modules = {f.fault.module for f in diagnosis.findings} or {next(iter(ruleset.modules))}
    faults = [f for f in ruleset.faults if f.id in named]
    faults += [f for f in ruleset.faults if f.module in modules and f.id not in named]
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
    diagnosis: Diagnosis, fault: FaultSpec, residuals: tuple[ResidualSpec, ...], found: bool
) -> str:
    cells = {c.residual: c for c in diagnosis.ruleset.cells_of_fault[fault.id]}
    body = "".join(_cell(fault, cells.get(r.id)) for r in residuals)
    style = f' class="found is-{fault.status}"' if found else ""
    return f'<tr{style}><th scope="row">{safe(fault.id)}</th>{body}</tr>'


def _cell(fault: FaultSpec, cell: Cell | None) -> str:
    if cell is None:
        return '<td class="soft">·</td>'
    degree = safe(smallest_degree(fault, cell.detectable, "over "))
    return f"<td><b>{'+' if cell.sign > 0 else '−'}</b><small>{degree}</small></td>"


def _broken(name: str) -> str:
    """A residual's name over several rows, as columns are narrow."""
    module, _, rest = name.partition(".")
    return "<br/>".join(safe(part) for part in (module, *rest.replace("-", "-\n").split("\n")))
