"""Pass 9, analyse isolability: which faults the residuals cannot isolate, and what would help.

Two faults *coincide* if they move all residuals in the same proportion: no reading of this plant
separates them at one operating point. A fault is *nested* in another if its signature is part of
the other's: they differ only in residuals that one of them leaves at zero, which noise may hide.
Other pairs are *close* if a small degree of one is detected, but lies within the noise of some
degree of the other.
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from rulec_runtime.contract.ruleset import AdvisedSensor, AmbiguousGroup

from rulec.language.write_yaml import rounded
from rulec.limits import SAME_DIRECTION
from rulec.passes.assemble import Assembly
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_signatures import Signatures
from rulec.passes.limits import SMALL_DEGREE
from rulec.passes.link import Network, observed_through_states
from rulec.passes.sensor_advice import Adviser


@dataclass(frozen=True)
class Isolability:
    """Ambiguous groups; `unobserved` modules and faults affect no residual."""

    groups: tuple[AmbiguousGroup, ...]
    unobserved: tuple[str, ...]


def analyse_isolability(
    network: Network, residuals: tuple[Residual, ...], assembly: Assembly, signatures: Signatures
) -> Isolability:
    """Compare the rows of the fault-symptom matrix.

    >>> from rulec.passes.pipeline import example
    >>> group = example("isolability").isolability.groups[0]
    >>> group.faults, group.kind
    (('A.leakage', 'A.dp.low'), 'nested')
    """
    faults = [h.id for h in assembly.hypotheses]
    effects = _matrix(residuals, signatures, faults)
    adviser = Adviser(network, assembly, signatures)
    shown = _by_detectability(signatures)
    found = dict.fromkeys(_coinciding(faults, effects), "coincide")
    found |= dict.fromkeys(_nested(faults, effects), "nested")
    pairs = {frozenset(pair) for names in found for pair in itertools.combinations(names, 2)}
    found |= {pair: "close" for pair in adviser.close_pairs() if frozenset(pair) not in pairs}
    groups = tuple(_group(adviser, shown, names, kind) for names, kind in found.items())
    silent = [f for f, row in zip(faults, effects, strict=True) if row.nnz == 0]
    watched = {r.module for r in residuals} | {
        o.split(".")[0] for r in residuals for _, o in r.terms
    }
    watched |= {c.fault.split(".")[0] for c in signatures.cells}
    watched |= observed_through_states(network) if network.stores else set()
    blind = [m for m in network.plant.modules if m not in watched]
    return Isolability(groups, (*blind, *silent))


Shown = Mapping[str, list[tuple[float, str]]]
"""Residuals of each fault with the smallest degree that they detect, in ascending order."""


def _matrix(
    residuals: tuple[Residual, ...], signatures: Signatures, faults: list[str]
) -> sparse.csr_matrix:
    """Effects per unit of degree, shape (faults, residuals), m3/s."""
    row = {name: i for i, name in enumerate(faults)}
    column = {name: i for i, name in enumerate(r.id for r in residuals)}
    entries = [c.sensitivity for c in signatures.cells]
    rows = [row[c.fault] for c in signatures.cells]
    columns = [column[c.residual] for c in signatures.cells]
    return sparse.csr_matrix((entries, (rows, columns)), (len(faults), len(residuals)))


def _coinciding(faults: list[str], effects: sparse.csr_matrix) -> list[tuple[str, ...]]:
    """Groups of faults whose rows have the same direction."""
    length = np.sqrt(np.asarray(effects.multiply(effects).sum(axis=1)).ravel())
    unit = sparse.diags(1.0 / np.where(length > 0, length, 1.0)) @ effects
    alike = sparse.coo_matrix(unit @ unit.T)
    partners: dict[int, set[int]] = {}
    for i, j, cosine in zip(alike.row, alike.col, alike.data, strict=True):
        if cosine > SAME_DIRECTION:
            partners.setdefault(int(i), set()).add(int(j))
    groups = dict.fromkeys(tuple(sorted(partners[i])) for i in sorted(partners))
    return [tuple(faults[j] for j in members) for members in groups if len(members) > 1]


def _nested(faults: list[str], effects: sparse.csr_matrix) -> list[tuple[str, str]]:
    """Sorted pairs (inner, outer) of faults, the signature of one being part of the other's."""
    signs = effects.sign()
    size = np.diff(signs.indptr)
    agree = sparse.coo_matrix(signs @ signs.T)
    pairs = sorted(
        (int(i), int(j))
        for i, j, common in zip(agree.row, agree.col, agree.data, strict=True)
        if i != j and common == size[i] < size[j]
    )
    return [(faults[i], faults[j]) for i, j in pairs]


def _group(adviser: Adviser, shown: Shown, names: tuple[str, ...], kind: str) -> AmbiguousGroup:
    """A group with the degrees that isolate its faults, and advice if these are not small."""
    degrees = adviser.degrees(names)
    far = not degrees or max(degrees) <= SMALL_DEGREE
    alike = adviser.of_one_reading(names)
    judged = tuple(group[0] for group in alike)
    advice = None if far else adviser.advise(judged)
    parts = list(_telling(adviser, shown, *names)) if kind == "nested" else []
    sensors: tuple[AdvisedSensor, ...] = ()
    if any(np.isfinite(degrees)) and not (far and parts):
        each = " and ".join(_above(adviser, n, x) for n, x in zip(names, degrees, strict=True))
        parts.append(f"reliably{'' if parts else ' distinguishable'} {each}")
    if advice is not None:
        added, degree = advice
        sensors = tuple(AdvisedSensor(s.module, s.signal, s.cost) for s in added)
        if added:
            more = " and ".join(s.title for s in added)
            does = "with" if parts else "distinguishable with"
            parts.append(f"{does} {more} above {adviser.sizes(judged, degree)}")
        for group in alike:
            if len(group) > 1:
                parts.append(f"{', '.join(group)} only by several operating points")
    elif not far:
        parts.append("no further reading there would help; compare several operating points")
    units = (adviser.in_unit(n, x) for n, x in zip(names, degrees, strict=False))
    sizes = tuple(rounded(x, 4) if math.isfinite(x) else None for x in units)
    return AmbiguousGroup(names, kind, "; ".join(parts), sizes, sensors)


def _above(adviser: Adviser, fault: str, degree: float) -> str:
    size = f"above {adviser.size(fault, degree)}" if np.isfinite(degree) else "at no degree"
    return f"{size} ({fault})"


def _by_detectability(signatures: Signatures) -> Shown:
    table: dict[str, list[tuple[float, str]]] = {}
    for cell in signatures.cells:
        table.setdefault(cell.fault, []).append((cell.detectable, cell.residual))
    return {fault: sorted(cells) for fault, cells in table.items()}


def _telling(adviser: Adviser, shown: Shown, inner: str, outer: str) -> Iterator[str]:
    """The residual that only the outer fault moves, and the smallest degree that it detects, if the
    fault can have it."""
    common = {residual for _, residual in shown[inner]}
    degree, residual = next((d, r) for d, r in shown[outer] if r not in common)
    if adviser.has(outer, degree):
        yield f"distinguishable by {residual} above {degree:.2g}{adviser.unit(outer)}"
