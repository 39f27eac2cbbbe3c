"""Beside the Fault Diagnosis Toolbox of Linköping: structural analysis of large plants.

Its way to diagnosers is to list all minimal sets of equations with redundancy (MSO sets), whose
number grows by a factor with each module. Ours takes the residuals of each module and its
neighbours.

Source: Frisk, Krysander, Jung: A toolbox for analysis and design of model based diagnosis systems
for large scale models, IFAC 2017; `faultdiagnosistoolbox` on PyPI.
"""

import tempfile
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset

from rulec.passes.pipeline import compile_plant
from tests.bench.rigs import chain
from tests.bench.row import Row, median

PEER = "faultdiagnosistoolbox"
TANKS, LINE = 12, 8
"""Tanks in series; modules of a line, of which both know the same."""


def rows() -> list[Row]:
    """A line of dosing modules and mixers, and tanks in series."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [*_lines(folder), _tanks(folder)]


def _lines(folder: Path) -> list[Row]:
    rules = _compiled(folder, chain(LINE))
    ours = median(lambda: compile_plant(folder))
    observers = [o.id for o in rules.observers]
    model = structure_of(
        rules,
        {
            f.id: [o for o in observers if f"dq:{o}:{f.id}" in rules.undo.outputs]
            for f in rules.faults
        },
    )
    begin = time.process_time()
    sets = model.MSO()
    theirs = time.process_time() - begin
    alone = median(lambda: model.IsolabilityAnalysis())
    same = f"a line of {LINE} modules, the same equations, readings and faults"
    return [
        Row(
            key="line-sets",
            what=f"rules of a line of {LINE} modules, with isolability",
            peer=f"{PEER}, all MSO sets",
            ours=ours,
            theirs=theirs,
            same=same,
            differs=f"{len(sets)} sets of equations there; here {len(rules.cells)} rules with "
            "uncertainties, and sensors that would help",
        ),
        Row(
            key="line-isolability",
            what=f"isolability of a line of {LINE} modules",
            peer=f"{PEER}, isolability alone",
            ours=ours,
            theirs=alone,
            same=same,
            differs="structure alone there; here the whole compiler runs, and says from which "
            "degree on faults are told apart",
        ),
    ]


def _tanks(folder: Path) -> Row:
    names = [f"T{i}" for i in range(1, TANKS + 1)]
    modules = "".join(f"  {name}: {{type: open-tank}}\n" for name in names)
    pipes = zip(["pump", *names], names, strict=False)
    joined = "".join(f"  - {a} -> {b}\n" for a, b in pipes)
    head = "plant: tanks\ntitle: tanks in series\nmodules:\n  pump: {type: voltage-pump}\n"
    rules = _compiled(folder, f"{head}{modules}connections:\n{joined}")
    assert rules.dynamics is not None
    ours = median(lambda: compile_plant(folder))
    model = tanks_in_series(TANKS)
    begin = time.process_time()
    model.MSO()
    theirs = time.process_time() - begin
    return Row(
        key="tanks-sets",
        what=f"{TANKS} tanks in series, each with a level sensor",
        peer=f"{PEER}, all MSO sets",
        ours=ours,
        theirs=theirs,
        same="number of tanks, readings, and faults of inflow, outlet and sensor",
        differs="there each outlet feels the next level; here outlets are free, and balances are "
        "fitted, so no set is listed",
    )


def _compiled(folder: Path, text: str) -> Ruleset:
    (folder / "plant.yaml").write_text(text, encoding="utf-8")
    return compile_plant(folder)


def structure_of(rules: Ruleset, acting: Mapping[str, Collection[str]]) -> Any:
    """Which flows, readings and faults stand in which equation of a plant: those of its observers,
    in their order, then its junctions. `acting`: observers in which each fault stands."""
    import faultdiagnosistoolbox as toolbox

    modules = dict.fromkeys(o.module for o in rules.observers)
    for junction in rules.junctions:
        modules |= dict.fromkeys((*junction.outlets, *junction.inlets))
    flow = {module: f"q{i}" for i, module in enumerate(modules)}
    reading = {
        s: f"z{i}" for i, s in enumerate(sorted({s for o in rules.observers for s in o.signals}))
    }
    fault = {name: f"f{i}" for i, name in enumerate(acting)}
    relations = [
        [flow[o.module], *(reading[s] for s in o.signals)]
        + [fault[name] for name, observers in acting.items() if o.id in observers]
        for o in rules.observers
    ]
    relations += [[flow[m] for m in (*j.outlets, *j.inlets)] for j in rules.junctions]
    names = {"x": [*flow.values()], "f": [*fault.values()], "z": [*reading.values()]}
    return toolbox.DiagnosisModel({"type": "VarStruc", **names, "rels": relations}, name="plant")


def tanks_in_series(count: int) -> Any:
    """Tanks of which each flows into the next, by the difference of levels."""
    import faultdiagnosistoolbox as toolbox
    from sympy import Symbol, sqrt

    unknown, known, faults, relations = [], ["q0"], [], []
    for i in range(1, count + 1):
        level, rate, flow = (Symbol(f"{name}{i}") for name in ("h", "dh", "q"))
        fed, blocked, wrong = (Symbol(f"{name}{i}") for name in ("fin", "fout", "fy"))
        unknown += [str(s) for s in (level, rate, flow)]
        known.append(f"y{i}")
        faults += [str(s) for s in (fed, blocked, wrong)]
        behind = Symbol(f"h{i + 1}") if i < count else 0
        relations += [
            -rate + Symbol(f"q{i - 1}") - flow + fed,
            -flow + sqrt(level - behind) + blocked,
            -Symbol(f"y{i}") + level + wrong,
            toolbox.DiffConstraint(str(rate), str(level)),
        ]
    form = {"type": "Symbolic", "x": unknown, "f": faults, "z": known, "rels": relations}
    return toolbox.DiagnosisModel(form, name="tanks")
