"""Pass 9, analyse isolability: which faults the residuals cannot tell apart, and what would help.

Two faults *coincide* where they move all residuals in the same proportion: no reading of this
plant separates them at one operating point. A fault is *nested* in another where its whole
signature is part of the other's: they differ only in residuals that one of them leaves at zero,
which noise may hide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from rulec.derive_rules import Rules

SAME_DIRECTION = 1.0 - 1e-9


@dataclass(frozen=True)
class Group:
    """Faults that are hard or impossible to tell apart; `kind` is ``coincide`` or ``nested``."""

    faults: tuple[str, ...]
    kind: str
    advice: str


@dataclass(frozen=True)
class Isolability:
    """Rules with their ambiguities; `unobserved` modules and faults leave no trace."""

    rules: Rules
    groups: tuple[Group, ...]
    unobserved: tuple[str, ...]


def analyse_isolability(rules: Rules) -> Isolability:
    """Compare the rows of the fault-symptom matrix."""
    assembly = rules.signatures.assembly
    faults = [h.id for h in assembly.hypotheses]
    effects = _matrix(rules, faults)
    groups = _coinciding(rules, faults, effects) + _nested(rules, faults, effects)
    silent = [f for f, row in zip(faults, effects, strict=True) if row.nnz == 0]
    watched = {r.module for r in assembly.residuals.residuals} | {
        o.split(".")[0] for r in assembly.residuals.residuals for _, o in r.terms
    }
    watched |= {c.fault.split(".")[0] for c in rules.signatures.cells}
    blind = [m for m in assembly.residuals.network.plant.modules if m not in watched]
    return Isolability(rules, tuple(groups), (*blind, *silent))


def _matrix(rules: Rules, faults: list[str]) -> sparse.csr_matrix:
    """Effects per unit of degree, shape (faults, residuals), in units of threshold."""
    signatures = rules.signatures
    residuals = [r.id for r in signatures.assembly.residuals.residuals]
    row = {name: i for i, name in enumerate(faults)}
    column = {name: i for i, name in enumerate(residuals)}
    entries = [c.sensitivity for c in signatures.cells]
    where = (
        [row[c.fault] for c in signatures.cells],
        [column[c.residual] for c in signatures.cells],
    )
    return sparse.csr_matrix((entries, where), (len(faults), len(residuals)))


def _coinciding(rules: Rules, faults: list[str], effects: sparse.csr_matrix) -> list[Group]:
    """Groups of faults whose rows point the same way."""
    length = np.sqrt(np.asarray(effects.multiply(effects).sum(axis=1)).ravel())
    unit = sparse.diags(1.0 / np.where(length > 0, length, 1.0)) @ effects
    alike = sparse.coo_matrix(unit @ unit.T)
    partners: dict[int, set[int]] = {}
    for i, j, cosine in zip(alike.row, alike.col, alike.data, strict=True):
        if cosine > SAME_DIRECTION:
            partners.setdefault(int(i), set()).add(int(j))
    groups, seen = [], set()
    for i in sorted(partners):
        members = tuple(sorted(partners[i]))
        if len(members) > 1 and members not in seen:
            seen.add(members)
            names = tuple(faults[j] for j in members)
            groups.append(Group(names, "coincide", _advice(rules, names)))
    return groups


def _nested(rules: Rules, faults: list[str], effects: sparse.csr_matrix) -> list[Group]:
    """Ordered pairs (inner, outer) of signatures, one part of the other."""
    signs = effects.sign()
    size = np.diff(signs.indptr)
    agree = sparse.coo_matrix(signs @ signs.T)
    pairs = sorted(
        (int(i), int(j))
        for i, j, common in zip(agree.row, agree.col, agree.data, strict=True)
        if i != j and common == size[i] < size[j]
    )
    shown = _by_detectability(rules)
    return [
        Group((faults[i], faults[j]), "nested", _telling(shown, faults[i], faults[j]))
        for i, j in pairs
    ]


def _advice(rules: Rules, names: tuple[str, ...]) -> str:
    """The measurement that would separate coinciding faults.

    An additional flow meter in the module of the first fault gives a residual that a fault of a
    flow or line leaves at zero against the line, while a faulty reading moves only its own
    observer; so it separates any two that do not act on the very same observers.
    """
    hypotheses = {h.id: h for h in rules.signatures.assembly.hypotheses}
    reached = {frozenset(hypotheses[n].affects) for n in names}
    modules = sorted({hypotheses[n].module for n in names})
    if len(reached) > 1:
        return f"a further flow meter in {' or '.join(modules)} would separate them"
    return "no further flow reading separates them; compare several operating points"


def _by_detectability(rules: Rules) -> dict[str, list[tuple[float, str]]]:
    """Residuals of each fault with the degree from which on they show it, smallest first."""
    table: dict[str, list[tuple[float, str]]] = {}
    for cell in rules.signatures.cells:
        table.setdefault(cell.fault, []).append((cell.detectable, cell.residual))
    return {fault: sorted(cells) for fault, cells in table.items()}


def _telling(shown: Mapping[str, list[tuple[float, str]]], inner: str, outer: str) -> str:
    """The residual that only the outer fault moves, and from which degree on it shows it."""
    common = {residual for _, residual in shown[inner]}
    degree, residual = next((d, r) for d, r in shown[outer] if r not in common)
    return f"{residual} tells them apart from a degree of {degree:.2g} on"
