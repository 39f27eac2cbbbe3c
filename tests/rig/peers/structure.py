"""Where something is missing, by structure alone: the Fault Diagnosis Toolbox of Linköping.

It gets the estimates of flow, the readings in each, the junctions, and a fault at each place. Of
its minimal sets of equations (MSO sets) those are asked that tell a reading as our simulation does;
one fires where the recalibrated plant is off by more than noise. Told are the places that are in
all sets that fire, as for a single fault; a set that does not fire exonerates nothing.

Source: Frisk, Krysander, Jung: A toolbox for analysis and design of model based diagnosis systems
for large scale models, IFAC 2017; `faultdiagnosistoolbox` on PyPI.
"""

from importlib.util import find_spec
from typing import Any

import numpy as np

from rulec.effects.candidate import DisturbanceLocation
from rulec.effects.model_builder import open_builder
from tests.rig.peers import limits
from tests.rig.peers.case import Case
from tests.rig.peers.library import _relation, _system

PEER = "faultdiagnosistoolbox"


def located(case: Case) -> tuple[tuple[str, ...], int] | None:
    """Places in all sets that fire, as `module.place`, all of them where none fires; and how many
    there are. None where the toolbox is not there, the plant stores, or no set tells a reading."""
    if find_spec(PEER) is None or case.stores:
        return None
    ruleset, builder = open_builder(case.base)
    system, spots = _system(ruleset, builder, case), builder.spots
    model, observers = _structure(case, spots)
    sets = model.MSO()
    signature = np.asarray(model.FSM(sets), dtype=bool)
    of = {frozenset(observers[i] for i in s if i in observers): k for k, s in enumerate(sets)}
    fired, asked = np.ones(len(spots), dtype=bool), 0
    for name in case.shown:
        relation = _relation(system, name, set(case.drivers))
        spec = next((r for r in ruleset.residuals if r.id == relation), None)
        noise = case.scored.noise.get(name)
        number = of.get(frozenset(t.observer for t in spec.terms)) if spec else None
        if number is None or not noise:
            continue
        asked += 1
        if case.left[name] > limits.FIRES * noise:
            fired &= signature[number]
    places = [f"{s.module}.{s.place}" for s in spots]
    open_ = dict.fromkeys(p for p, own in zip(places, fired, strict=True) if own)
    return (tuple(open_), len(set(places))) if asked else None


def _structure(case: Case, spots: tuple[DisturbanceLocation, ...]) -> tuple[Any, dict[int, str]]:
    """The model of the toolbox, and the observer of each equation that has one."""
    import faultdiagnosistoolbox as toolbox

    rules = case.rules
    modules = dict.fromkeys(o.module for o in rules.observers)
    for junction in rules.junctions:
        modules |= dict.fromkeys((*junction.outlets, *junction.inlets))
    flow = {module: f"q{i}" for i, module in enumerate(modules)}
    reading = {s.id: f"z{i}" for i, s in enumerate(rules.signals)}
    fault = {s.id: f"f{i}" for i, s in enumerate(spots)}
    relations = [
        [flow[o.module], *(reading[s] for s in o.signals)]
        + [fault[s.id] for s in spots if o.id in s.observers]
        for o in rules.observers
    ]
    relations += [[flow[m] for m in (*j.outlets, *j.inlets)] for j in rules.junctions]
    names = {"x": [*flow.values()], "f": [*fault.values()], "z": [*reading.values()]}
    model = toolbox.DiagnosisModel({"type": "VarStruc", **names, "rels": relations}, name="rig")
    return model, {i: o.id for i, o in enumerate(rules.observers)}
