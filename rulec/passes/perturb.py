"""Plants of the same kind with parameters drawn from their uncertainties.

A ruleset folds parameter values into constants, from which every real plant differs. A perturbed
plant is made by lowering the equations again with other values.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Plan

from rulec.knowledge.plant import Module
from rulec.passes.corrected_observers import undo_graph
from rulec.passes.types import Compilation


def true_plan(models: Compilation, faults: Iterable[str], random: np.random.Generator) -> Plan:
    """The undo plan of a plant whose parameters are drawn from their covariance.

    Parameters
    ----------
    models : a compilation up to the pass `differentiate`, whose symbolic work serves all draws.
    faults : ids of all faults, as in the ruleset.
    """
    drawn = perturbed(models, random)
    return undo_graph(drawn.network, drawn.types, tuple(faults)).plan()


def perturbed(models: Compilation, random: np.random.Generator) -> Compilation:
    """The models with new values of all uncertain parameters."""
    modules = {name: _drawn(m, random) for name, m in models.plant.modules.items()}
    plant = replace(models.plant, modules=modules)
    return replace(models, plant=plant, network=replace(models.network, plant=plant))


def _drawn(module: Module, random: np.random.Generator) -> Module:
    """A module with parameters drawn from normal distributions; those of a block jointly."""
    values = {p.name: p.value for p in module.parameters.values()}
    joint = {name for block in module.blocks for name in block.parameters}
    for block in module.blocks:
        shifts = np.array(block.factor) @ random.standard_normal(len(block.parameters))
        for name, shift in zip(block.parameters, shifts, strict=True):
            values[name] += float(shift)
    for parameter in module.parameters.values():
        if parameter.name not in joint and parameter.u:
            values[parameter.name] += parameter.u * float(random.standard_normal())
    parameters = {name: replace(p, value=values[name]) for name, p in module.parameters.items()}
    return replace(module, parameters=parameters)
