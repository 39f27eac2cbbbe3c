"""The true flow that a calibration fits to, with its errors.

It follows from the equation of a module's own reference observer: a current loop that reads mA, a
venturi, a meter with a zero of its own. Without one, a reading of a volume flow counts, or
continuity with the meters of other modules. A reading that enters another law, such as the flow in
the main that a module doses into, is not the flow through the module.

Each error is one column: how far the flow would move, at every point, if one sensor or one
parameter of the equation were one standard uncertainty off (GUM, 5.1: first order).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array, Plan

from rulec.algebra.continuity import flows_by_continuity
from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.knowledge.plant import Module
from rulec.passes.differentiate import GATHERED, TypeModel
from rulec.passes.types import Compilation


@dataclass(frozen=True)
class TrueFlow:
    """`values`, m3/s, NaN where not known; `errors` and `noise` per source; all of shape (n,).

    Errors are the same at all points, noise is new at each. Readings of the module itself have
    their local names as sources.
    """

    name: str
    values: Array
    errors: Mapping[str, Array]
    noise: Mapping[str, Array]


@dataclass(frozen=True)
class Local:
    """Readings of a module by their local names, with systematic and statistical standard
    uncertainties, each shape (n,), SI."""

    values: Mapping[str, Array]
    systematic: Mapping[str, Array]
    statistical: Mapping[str, Array]


def readings_of(model: TypeModel, observer: str) -> list[str]:
    """Readings of an observer: signals of its module, and sums of those downstream."""
    gradient = model.gradients[observer]
    return [n for n in gradient if n in model.type.signals or n.startswith(GATHERED)]


def observer_plan(model: TypeModel, observer: str, by: Iterable[str]) -> Plan:
    """An observer as ``Q`` with parameters as inputs, its slopes ``d:<name>``, and its changes by
    the forms of its laws, ``form:<law>``."""
    graph = Graph(model.symbols)
    symbols = {symbol: graph.input(name) for name, symbol in model.symbols.items()}
    graph.outputs["Q"] = lower(graph, model.observers[observer], symbols)
    for name in by:
        graph.outputs[f"d:{name}"] = lower(graph, model.gradients[observer][name], symbols)
    for law, change in model.forms[observer].items():
        graph.outputs[f"form:{law}"] = lower(graph, change, symbols)
    return graph.plan()


def true_flows(models: Compilation, local: Mapping[str, Local]) -> dict[str, TrueFlow]:
    """The true flow of every module that has one."""
    network = models.network
    own: dict[str, TrueFlow] = {}
    for module in network.plant.modules.values():
        found = _own(module, models.types[module.type.key], local[module.name])
        if found is not None:
            own[module.name] = found
    by_continuity = flows_by_continuity(network.graph, own).items()
    return own | {name: _balanced(own, fixed.terms) for name, fixed in by_continuity}


def _own(module: Module, model: TypeModel, local: Local) -> TrueFlow | None:
    for observer in module.type.observers.values():
        if observer.is_reference:
            return _by_equation(module, model, observer.name, local)
    laws = model.observers.values()
    for signal in module.type.signals.values():
        symbol = model.symbols[signal.name]
        own = symbol in laws or not any(symbol in law.free_symbols for law in laws)
        if signal.quantity == "volume flow" and own and signal.name in local.values:
            name = signal.name
            errors, noise = {name: local.systematic[name]}, {name: local.statistical[name]}
            return TrueFlow(f"{module.name}.{name}", local.values[name], errors, noise)
    return None


def _by_equation(module: Module, model: TypeModel, reference: str, local: Local) -> TrueFlow | None:
    """The flow by a reference observer; None if one of its readings was not recorded."""
    read, values = readings_of(model, reference), local.values
    if any(name not in values for name in read):
        return None
    gradient = model.gradients[reference]
    uncertain = {n: p.u for n, p in module.parameters.items() if n in gradient and p.u}
    plan = observer_plan(model, reference, [*read, *uncertain])
    out = plan.run({**{n: p.value for n, p in module.parameters.items()}, **values})
    finite = np.all([np.isfinite(values[name]) for name in read], axis=0)
    flow = np.where(finite & np.isfinite(out["Q"]), out["Q"], np.nan)
    errors = {name: out[f"d:{name}"] * local.systematic[name] for name in read}
    noise = {name: out[f"d:{name}"] * local.statistical[name] for name in read}
    errors |= {
        f"{module.name}.{name}": np.broadcast_to(out[f"d:{name}"] * u, flow.shape)
        for name, u in uncertain.items()
    }
    sources = " + ".join(f"{module.name}.{name.removeprefix(GATHERED)}" for name in read)
    return TrueFlow(sources, flow, errors, noise)


def _balanced(own: Mapping[str, TrueFlow], terms: Mapping[str, int]) -> TrueFlow:
    """A flow as a sum of others; the errors of several meters become one."""
    flow: Array = np.sum([sign * own[m].values for m, sign in terms.items()], axis=0)
    name = " + ".join(own[m].name for m in terms)
    errors = _joined(name, {m: own[m].errors for m in terms}, terms)
    return TrueFlow(name, flow, errors, _joined(name, {m: own[m].noise for m in terms}, terms))


def _joined(
    name: str, errors: Mapping[str, Mapping[str, Array]], terms: Mapping[str, int]
) -> dict[str, Array]:
    """Errors of flows, per module and source, as errors of their sum."""
    parts = [(m, source, e) for m in terms for source, e in errors[m].items()]
    if len(terms) == 1:
        (sign,) = terms.values()
        return {f"{m}.{source}": sign * e for m, source, e in parts}
    return {name: np.sqrt(np.sum([e**2 for _, _, e in parts], axis=0))}
