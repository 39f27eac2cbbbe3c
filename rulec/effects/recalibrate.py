"""The values of a repaired plant as a calibration file, which replaces the old ones."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.adopt import Adopted, Adoption
from rulec.effects.candidate import Repair
from rulec.knowledge.module_type import Parameter
from rulec.language.units import Unit
from rulec.language.write_yaml import rounded
from rulec.passes.lower import parameter_id

FLOW_FACTOR = 3.6e6  # l/h per m3/s

FULL, U_DIGITS = 15, 10
"""Significant digits of values and covariances, which must stay positive, and of the rest."""


def calibration(adoption: Adoption, repair: Repair) -> dict[str, Any]:
    """Content of the calibration file of the new plant."""
    entries = {name: _entry(own, repair) for name, own in adoption.instances.items()}
    return {
        "calibration": adoption.plant.name,
        "modules": {name: entry for name, entry in entries.items() if len(entry) > 1},
    }


def _entry(own: Adopted, repair: Repair) -> dict[str, Any]:
    index = {name: i for i, name in enumerate(p.id for p in repair.parameters)}
    found = {local: index[id_] for local, id_ in _ids(own).items() if id_ in index}
    values = _values(own, repair, found)
    module = own.module
    ids = {o: f"{module.name}.{o}" for o in module.type.observers}
    fitted = {o: repair.misfit[id_] for o, id_ in ids.items() if id_ in repair.misfit}
    misfit = {**module.misfit, **fitted}
    entry = {
        "type": own.type.name,
        "parameters": {name: _parameter(p) for name, p in values.items()},
        "covariance": _blocks(own, repair, found, values),
        "misfit": {name: flow_entry(m) for name, m in misfit.items()},
        "range": _ranges(own, repair),
    }
    return {key: value for key, value in entry.items() if value}


def _ids(own: Adopted) -> dict[str, str]:
    """Ids of the type's parameters in the analysis. Parameters whose error is shared with other
    modules belong to the fluid; no file has them."""
    plain = (name for name, p in own.module.parameters.items() if not p.shared)
    return {**{name: parameter_id(own.module, name) for name in plain}, **own.inputs}


def _values(own: Adopted, repair: Repair, found: Mapping[str, int]) -> dict[str, Parameter]:
    """Parameters that differ from those of the type, or whose covariance is known."""
    module, result = own.module, dict[str, Parameter]()
    joint = {name for block in module.blocks for name in block.parameters}
    for name, parameter in module.parameters.items():
        declared = module.type.parameters[name]
        if parameter.shared:
            continue
        if name in found:
            new = repair.parameters[found[name]]
            parameter = replace(parameter, value=new.value, u=new.u)
        elif name not in joint and (parameter.value, parameter.u) == (declared.value, declared.u):
            continue
        result[name] = parameter
    return {**result, **own.brought}


def _blocks(
    own: Adopted, repair: Repair, found: Mapping[str, int], values: Mapping[str, Parameter]
) -> list[dict[str, Any]]:
    """Joint covariance of the fitted parameters, and what remains of the old blocks."""
    result = []
    fitted = [n for n in values if n in found and repair.covariance[found[n], found[n]] > 0.0]
    if len(fitted) > 1:
        rows = [found[name] for name in fitted]
        units = [values[name].unit for name in fitted]
        result.append(block_entry(fitted, units, repair.covariance[np.ix_(rows, rows)]))
    for block in own.module.blocks:
        kept = [i for i, name in enumerate(block.parameters) if name not in found]
        if kept:
            factor = np.array(block.factor)
            covariance = (factor @ factor.T)[np.ix_(kept, kept)]
            names = [block.parameters[i] for i in kept]
            result.append(block_entry(names, [values[n].unit for n in names], covariance))
    return result


def block_entry(names: Sequence[str], units: Sequence[Unit], covariance: Array) -> dict[str, Any]:
    """A joint covariance (SI), shape (n, n), as written in a calibration file."""
    scale = np.array([unit.factor for unit in units])
    shown = covariance / np.outer(scale, scale)
    shown = (shown + shown.T) / 2.0
    return {"of": list(names), "matrix": [[rounded(v, FULL) for v in row] for row in shown]}


def _ranges(own: Adopted, repair: Repair) -> dict[str, Any]:
    """Where the equations are valid: in the range of calibration and of this recording."""
    module, result = own.module, dict[str, Any]()
    for name, signal in module.type.signals.items():
        ends = [module.valid[name]] if name in module.valid else []
        if f"{module.name}.{name}" in repair.ranges:
            ends.append(repair.ranges[f"{module.name}.{name}"])
        if ends:
            low, high = min(e[0] for e in ends), max(e[1] for e in ends)
            result[name] = range_entry(signal.unit, low, high)
    return result


def range_entry(unit: Unit, low: float, high: float) -> dict[str, Any]:
    """A range (SI) as written in a calibration file."""
    ends = (rounded(unit.from_si(end), U_DIGITS) for end in (low, high))
    return {**dict(zip(("from", "to"), ends, strict=True)), "unit": unit.text}


def flow_entry(flow: float) -> dict[str, Any]:
    """A flow (m3/s) as written in a calibration file."""
    return {"value": rounded(flow * FLOW_FACTOR, U_DIGITS), "unit": "l/h"}


def _parameter(parameter: Parameter) -> dict[str, Any]:
    """The value in full, so that the plant reads what was fitted; uncertainty to ten digits."""
    unit = parameter.unit
    return {
        "value": rounded(unit.from_si(parameter.value), FULL),
        "unit": unit.text,
        "u": rounded(parameter.u / unit.factor, U_DIGITS),
    }
