"""Parameters that follow an unrecorded driver, as possible places of an error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.effects.candidate import Candidate, DisturbanceLocation
from rulec.mismatch.evidence.steady.configuration import CHANGE
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import Suspect, suspect_at
from rulec.mismatch.evidence.steady.system import System


def varying_parameters(fitted: Fitted, spot: DisturbanceLocation) -> list[Suspect]:
    """Parameters of the law at a place, each with its own course.

    A driver seldom adds to a law: it changes a parameter, and shows where that parameter matters.
    """
    rows, system = fitted.rows, fitted.rows.system
    if spot.kind != "definition":
        return []
    parameters = system.builder.parameters
    own = [i for i, n in enumerate(parameters.ids) if n.partition(".")[0] == spot.module]
    names = [parameters.ids[i] for i in own]
    modules = system.reached(spot.observers)
    slopes = system.flows(fitted.setting, names, modules=modules, at=fitted.predicted).by_value
    reached = {system.number[o] for o in spot.observers if o in system.number}
    found = []
    for i, name in zip(own, names, strict=True):
        changed = {k: v for k, v in slopes[name].items() if np.any(np.nan_to_num(v))}
        if set(changed) != reached:
            continue
        changing = replace(
            spot,
            id=f"parameter:{name}",
            kind="parameter",
            unit=parameters.units[i],
            factor=float(parameters.factors[i]),
            unknown=name + CHANGE,
        )
        found.append(suspect_at(fitted, changing, rows.column(fitted.maps, changed)))
    return found


def spot_of(system: System, candidate: Candidate) -> DisturbanceLocation:
    """The place of a candidate that represents an unrecorded driver."""
    spots = system.builder.spots
    known = next((s for s in spots if s.id == candidate.id), None)
    if known is not None:
        return known
    here = next(s for s in spots if (s.module, s.place) == (candidate.module, candidate.place))
    (unknown,) = candidate.unknowns
    return replace(
        here,
        id=candidate.id,
        kind="parameter",
        unit=unknown.unit,
        factor=unknown.factor,
        unknown=unknown.id,
    )
