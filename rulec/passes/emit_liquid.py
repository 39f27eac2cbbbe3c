"""Changes of the liquid, as the runtime tries them: faults of no module."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping

import numpy as np
import sympy
from rulec_runtime.contract.ruleset import USUAL, Cell, FaultSpec, LiquidSpec
from rulec_runtime.contract.threshold import threshold_of

from rulec.knowledge.knowledge import FaultType, Variant
from rulec.knowledge.plant import Plant
from rulec.language.written import filled, rounded
from rulec.limits import ABSURD_FAULT, DIGITS, LIQUID_SEEN
from rulec.passes.assemble import Assembly
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_signatures import Signatures
from rulec.passes.differentiate import law_of, liquids_of
from rulec.passes.liquid import liquid_id

THERMOMETER = "temperature"
"""Quantity of readings that say whether the liquid is warm."""


def liquid_specs(
    plant: Plant, assembly: Assembly, residuals: tuple[Residual, ...], signatures: Signatures
) -> Iterator[LiquidSpec]:
    """All changes of the liquid that several modules would show."""
    known = liquids_of(plant.knowledge) if assembly.liquid else ()
    slopes = _slopes(assembly, signatures) if assembly.liquid else {}
    for fault in known:
        assert fault.liquid is not None, "checked when the fault was read"
        for variant in fault.variants:
            id_ = liquid_id(fault.liquid, variant.name)
            if id_ in assembly.liquid:
                yield LiquidSpec(
                    fault=_fault(plant, assembly, fault, variant, id_),
                    cells=tuple(_cells(id_, residuals, signatures, slopes)),
                    sign=_sign(variant),
                    per_kelvin=fault.liquid.per_kelvin,
                    factor=fault.liquid.factor,
                    thermometers=tuple(
                        f"{m.name}.{s.name}"
                        for m in plant.modules.values()
                        for s in m.type.signals.values()
                        if s.quantity == THERMOMETER
                    ),
                )


def _fault(
    plant: Plant, assembly: Assembly, fault: FaultType, variant: Variant, id_: str
) -> FaultSpec:
    """The fault; whatever reading its observers rest on may leave the calibrated range with it."""
    affects = assembly.liquid[id_]
    given = {f"{m.name}.{s.name}" for m in plant.modules.values() for s in m.type.signals.values()
             if s.is_input}  # fmt: skip
    read = dict.fromkeys(s for o in affects for s in assembly.gradients[o] if s in plant.signals)
    often, usual = variant.frequency or fault.frequency, variant.usual
    far = usual.size * usual.factor**ABSURD_FAULT if usual and not usual.of_place else math.inf
    return FaultSpec(
        id=id_,
        module="",
        fault=fault.name,
        title=f"{fault.title}, {variant.title}" if variant.name else fault.title,
        text=filled(fault.text, {"variant": variant.title}),
        action=fault.action,
        status=fault.status,
        lowest=float(variant.lowest),
        highest=float(variant.highest),
        tolerance=float(fault.tolerance),
        meaning=variant.meaning,
        affects=affects,
        scales=tuple(s for s in read if s not in given),
        in_sensor=False,
        origin=f"{fault.origin.file}:{fault.origin.line} ({fault.origin.source})",
        frequency=often.word if often else USUAL,
        frequency_origin=f"{often.origin.file}:{often.origin.line} ({often.origin.source})"
        if often
        else "",
        absurd=far if far < variant.highest else None,
    )


def _slopes(assembly: Assembly, signatures: Signatures) -> Mapping[tuple[str, str], float]:
    """By fault and observer the slope of the flow with the change undone, at the reference."""
    outputs = {n: node for n, node in assembly.undo.outputs.items() if n.startswith("dql:")}
    plan = assembly.undo.plan(outputs)
    inputs: dict[str, float] = {n: 0.0 for n in plan.inputs if n.startswith("x:")}
    inputs |= {n: signatures.reference[n] for n in plan.inputs if n in signatures.reference}
    found = plan.run(inputs)
    parts = {name: name.split(":", 2) for name in outputs}
    return {(parts[n][2], parts[n][1]): float(np.ravel(value)[0]) for n, value in found.items()}


def _cells(
    fault: str,
    residuals: tuple[Residual, ...],
    signatures: Signatures,
    slopes: Mapping[tuple[str, str], float],
) -> Iterator[Cell]:
    """Residuals that it moves, those left out that it moves next to nothing."""
    moved = {r.id: -sum(s * slopes.get((fault, o), 0.0) for s, o in r.terms) for r in residuals}
    finite = [abs(m) for m in moved.values() if math.isfinite(m)]
    least = LIQUID_SEEN * max(finite, default=0.0)
    for residual in residuals:
        slope = moved[residual.id]
        if not math.isfinite(slope) or abs(slope) <= least:
            continue
        seen = threshold_of(signatures.uncertainties[residual.id]) / abs(slope)
        yield Cell(
            fault,
            residual.id,
            1 if slope > 0.0 else -1,
            rounded(slope, DIGITS),
            rounded(slope, DIGITS),
            rounded(seen, DIGITS),
            (),
            f"{residual} moves with the liquid",
        )


@functools.cache
def _sign(variant: Variant) -> int:
    """Which way the property changes."""
    x = sympy.Symbol("x", real=True)
    change = sympy.diff(law_of(variant, sympy.S.One, x), x).subs(x, 0)
    return 1 if change > 0 else -1
