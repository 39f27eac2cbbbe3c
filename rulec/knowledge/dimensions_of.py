"""Dimensions of all names in the equations of a module type."""

from __future__ import annotations

from collections.abc import Mapping

from rulec.knowledge.module_type import ENDS, ModuleType
from rulec.language.dimension import dimension
from rulec.language.units import UNKNOWN, VOLUME_FLOW, Dimension


def dimensions_of(
    kind: ModuleType, gathered: Mapping[str, Dimension] | None = None
) -> dict[str, Dimension]:
    """Dimension of each signal, parameter, state and definition; `gathered`: of downstream sums."""
    sums = dict.fromkeys(kind.gathers, UNKNOWN) if gathered is None else gathered
    known = {n: s.unit.dimension for n, s in kind.signals.items()}
    known |= {n: p.unit.dimension for n, p in kind.parameters.items()}
    known |= {n: s.unit.dimension for n, s in kind.states.items()}
    known |= dict.fromkeys(ENDS, VOLUME_FLOW) if kind.flows else {}
    for definition in kind.definitions.values():  # in order of use
        known[definition.name] = dimension(definition.expression, known, sums)
    return known
