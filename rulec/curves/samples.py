"""What settled points of a recording say of a definition: an observer's law solved for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sympy
from rulec_runtime.contract.plan import Array, Plan

from rulec.algebra.derivative import derivative
from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.calibration.fit import CalibrationRefused
from rulec.calibration.true_flow import Local, TrueFlow
from rulec.knowledge.module_type import ModuleType
from rulec.knowledge.plant import Module
from rulec.passes.differentiate import GATHERED, TypeModel, opened, written_out

CURVE, DRIVER, BEFORE = "curve", "driver", "before"
"""An input and two outputs of the plan of a point."""


@dataclass(frozen=True)
class Samples:
    """At each point the `driver`, the definition `before` learning, the true `flow` (m3/s), and a
    plan that gives the flow of an observer as a function of `CURVE`."""

    plan: Plan
    inputs: Mapping[str, Array | float]
    driver: Array
    before: Array
    flow: Array

    def at(self, rows: np.ndarray) -> Samples:
        """The points of these rows."""
        inputs = {n: v[rows] if isinstance(v, np.ndarray) else v for n, v in self.inputs.items()}
        return Samples(self.plan, inputs, self.driver[rows], self.before[rows], self.flow[rows])

    def run(self, curve: Array) -> tuple[Array, Array, dict[str, Array]]:
        """The error of the law, its slope by the curve, and all outputs of the plan."""
        out = self.plan.run({**self.inputs, CURVE: curve})
        wide = {n: np.broadcast_to(v, curve.shape) for n, v in out.items()}
        return wide["Q"] - self.flow, wide[f"d:{CURVE}"], wide


def samples_of(
    model: TypeModel,
    kind: ModuleType,
    module: Module,
    definition: str,
    over: str,
    own: Local,
    true: TrueFlow,
) -> Samples:
    """Samples by the first observer that uses the definition and whose readings are recorded."""
    symbol, observers = opened(kind, definition, model.symbols, model.observers)
    reference = {o.name for o in kind.observers.values() if o.is_reference}
    found = [e for n, e in observers.items() if symbol in e.free_symbols and n not in reference]
    lacking = [[n for n in _readings(e, model) if n not in own.values] for e in found]
    whole = [e for e, lacks in zip(found, lacking, strict=True) if not lacks]
    if not whole:
        why = f"the recording lacks {', '.join(lacking[0])}" if found else "no observer uses it"
        raise CalibrationRefused(f"{module.name}.{definition}: {why}")
    table = written_out(kind, model.symbols, {})
    graph = Graph((*model.symbols, CURVE))
    nodes = {s: graph.input(n) for n, s in model.symbols.items()} | {symbol: graph.input(CURVE)}
    uncertain = [n for n, p in module.parameters.items() if p.u]
    read = [*_readings(whole[0], model), *uncertain]
    by = {CURVE: symbol, **{n: model.symbols[n] for n in read}}
    outputs = {"Q": whole[0], **{f"d:{n}": derivative(whole[0], s) for n, s in by.items()}}
    outputs |= {DRIVER: table[over], BEFORE: table[definition]}
    for name, expression in outputs.items():
        graph.outputs[name] = lower(graph, expression, nodes)
    plan = graph.plan()
    inputs: dict[str, Array | float] = {n: p.value for n, p in module.parameters.items()}
    inputs |= own.values
    out = plan.run(inputs)
    driver, before = (np.broadcast_to(out[n], true.values.shape) for n in (DRIVER, BEFORE))
    return Samples(plan, inputs, driver, before, true.values)


def _readings(expression: sympy.Expr, model: TypeModel) -> list[str]:
    free = expression.free_symbols
    return [
        n for n, s in model.symbols.items()
        if s in free and (n in model.type.signals or n.startswith(GATHERED))
    ]  # fmt: skip
