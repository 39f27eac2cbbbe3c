"""Pass 12, emit: everything the runtime needs, as data."""

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import rulec_runtime.contract.ruleset as contract
import sympy
from rulec_runtime.contract.threshold import threshold_of

from rulec.algebra.derivative import derivative
from rulec.knowledge.knowledge import FaultType, Variant
from rulec.knowledge.module_type import Signal
from rulec.knowledge.plant import Module, Plant
from rulec.language.diagnostics import Origin
from rulec.language.write_yaml import filled, rounded
from rulec.passes.analyse_isolability import Isolability
from rulec.passes.assemble import Assembly, Hypothesis
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_signatures import Signatures
from rulec.passes.differentiate import law_of, liquids_of
from rulec.passes.limits import ABSURD_FAULT, DIGITS, LIQUID_SEEN
from rulec.passes.link import Network, junctions
from rulec.passes.liquid import liquid_id
from rulec.passes.put_balances import Balanced, StoreFault

THERMOMETER = "temperature"
"""Quantity of readings that give the temperature of the liquid."""


def emit(
    network: Network,
    residuals: tuple[Residual, ...],
    assembly: Assembly,
    signatures: Signatures,
    rules: tuple[contract.Cell, ...],
    isolability: Isolability,
    simulation: contract.Simulation,
    balanced: Balanced,
) -> contract.Ruleset:
    """Make the ruleset of a plant; the same sources always give the same ruleset.

    >>> from rulec.passes.pipeline import example
    >>> ruleset = example("ruleset").ruleset
    >>> len(ruleset.residuals), len(ruleset.faults), len(ruleset.cells)
    (9, 18, 76)
    """
    plant = network.plant
    detectable = {cell.fault for cell in signatures.unlisted}
    # Faults in the balances are observed even if no estimate shows them.
    in_balances = balanced.dynamics.faults if balanced.dynamics is not None else ()
    return contract.Ruleset(
        format_version=contract.FORMAT_VERSION,
        plant=plant.name,
        title=plant.title,
        sources=plant.digest,
        modules={m.name: m.title for m in plant.modules.values()},
        signals=tuple(
            _signal(plant, module, signal, signatures.reference[f"{module.name}.{signal.name}"])
            for module in plant.modules.values()
            for signal in module.type.signals.values()
        ),
        columns=plant.columns,
        time_column=plant.time_column,
        time_zone=plant.time_zone,
        file=plant.file,
        units={
            name: contract.UnitSpec(u.factor, u.offset, tuple(map(float, u.dimension.exponents)))
            for name, u in plant.knowledge.units.units.items()
        },
        observers=tuple(_observers(plant, assembly, signatures)),
        junctions=network.balances,
        residuals=tuple(
            contract.ResidualSpec(
                r.id,
                r.module,
                tuple(contract.Term(o, s) for s, o in r.terms),
                str(r),
                rounded(signatures.uncertainties[r.id], DIGITS),
            )
            for r in residuals
        ),
        faults=(
            *(_settled(h) for h in assembly.hypotheses),
            *(_of_store(f) for f in balanced.faults if not f.settled),
        ),
        cells=rules,
        ambiguous=isolability.groups,
        unobserved=tuple(name for name in isolability.unobserved if name not in in_balances),
        parameters=_parameters(plant),
        simulation=simulation,
        plan=assembly.graph.plan(),
        undo=assembly.undo.plan(),
        dynamics=balanced.dynamics,
        knowledge=tuple(
            contract.KnowledgeSpec(name=layer.name, version=layer.version, digest=digest)
            for layer, digest in (plant.layers if len(plant.layers) > 1 else ())
        ),
        unbalanced=tuple(b for b in junctions(plant) if b not in network.balances),
        unlisted=tuple(_settled(h, unlisted=True) for h in assembly.unlisted if h.id in detectable),
        unlisted_cells=tuple(signature.cell() for signature in signatures.unlisted),
        regimes=tuple(_regimes(plant, assembly)),
        liquid=tuple(_liquid(plant, assembly, residuals, signatures)),
    )


def _regimes(plant: Plant, assembly: Assembly) -> Iterator[contract.RegimeSpec]:
    """Regimes of all modules, without those that use states."""
    for module in plant.modules.values():
        for regime in module.type.settled().regimes.values():
            name = f"{module.name}.{regime.name}"
            yield contract.RegimeSpec(
                id=name,
                module=module.name,
                title=regime.title,
                text=filled(regime.text, {"module": module.name}),
                action=regime.action,
                status=regime.status,
                when=tuple(
                    contract.RegimeCondition(
                        c.text,
                        f"{module.name}.{c.signal}" if c.signal else "",
                        c.above,
                        "" if c.signal else f"{name}:{i}",
                    )
                    for i, c in enumerate(regime.when)
                ),
                origin=_origin(regime.origin),
            )


def _signal(plant: Plant, module: Module, signal: Signal, reference: float) -> contract.SignalSpec:
    sensor = plant.knowledge.sensors[signal.sensor]
    low, high = module.valid.get(signal.name, (None, None))
    return contract.SignalSpec(
        id=f"{module.name}.{signal.name}",
        title=f"{signal.quantity} of {module.title}",
        unit=signal.unit.text,
        factor=signal.unit.factor,
        offset=signal.unit.offset,
        kind=sensor.kind,
        standard=sensor.standard * plant.spread(f"{module.name}.{signal.name}"),
        full_scale=signal.full_scale,
        lowest=signal.lowest,
        highest=signal.highest,
        minimum=signal.minimum,
        valid_from=low,
        valid_to=high,
        is_input=signal.is_input,
        reference=rounded(reference, 12) if reference == reference else 0.0,
        between=signal.between,
    )


def _observers(
    plant: Plant, assembly: Assembly, signatures: Signatures
) -> Iterator[contract.ObserverSpec]:
    signals = set(plant.signals)
    for module in plant.modules.values():
        for observer in module.type.observers.values():
            key = f"{module.name}.{observer.name}"
            texts = enumerate(text for text, _ in assembly.guards[key])
            yield contract.ObserverSpec(
                id=key,
                module=module.name,
                component=observer.component,
                equation=f"{key} = {observer.expression}",
                signals=tuple(sorted(n for n in assembly.gradients[key] if n in signals)),
                guards=tuple(contract.Guard(f"guard:{key}:{i}", text) for i, text in texts),
                misfit=module.misfit.get(observer.name, 0.0),
                reference=rounded(signatures.flows[key], DIGITS),
                origin=_origin(observer.origin),
            )


def _settled(h: Hypothesis, unlisted: bool = False) -> contract.FaultSpec:
    """A fault in the estimates of settled flows."""
    found = _fault(h.fault.fault, h.fault.variant, h.id, h.module, h.target, h.affects, h.scales)
    return replace(found, unlisted=unlisted)


def _of_store(f: StoreFault) -> contract.FaultSpec:
    """A fault in the balances only, which affects no estimate of a settled flow."""
    scales = (f.target,) if f.fault.acts_on == "signal" else ()
    return _fault(f.fault, f.variant, f.id, f.module, f.target, (), scales)


def _fault(
    fault: FaultType,
    variant: Variant,
    id_: str,
    module: str,
    target: str,
    affects: tuple[str, ...],
    scales: tuple[str, ...],
) -> contract.FaultSpec:
    """A fault of a module at a target, or of the liquid, which has neither."""
    title = f"{fault.title}, {variant.title}" if variant.name else fault.title
    slots = {"module": module, "where": target, "variant": variant.title}
    frequency, usual = variant.frequency or fault.frequency, variant.usual
    absurd = usual.size * usual.factor**ABSURD_FAULT if usual and not usual.of_place else math.inf
    return contract.FaultSpec(
        id=id_,
        module=module,
        fault=fault.name,
        title=fault.title_at(target, variant) if target else title,
        text=filled(fault.text, slots),
        action=fault.action,
        status=fault.status,
        lowest=float(variant.lowest),
        highest=float(variant.highest),
        tolerance=float(fault.tolerance),
        meaning=variant.meaning,
        affects=affects,
        scales=scales,
        in_sensor=fault.acts_on == "signal",
        origin=_origin(fault.origin),
        unit=variant.unit,
        frequency=frequency.word if frequency else contract.USUAL,
        frequency_origin=_origin(frequency.origin) if frequency else "",
        absurd=absurd if absurd < variant.highest else None,
    )


def _liquid(
    plant: Plant, assembly: Assembly, residuals: tuple[Residual, ...], signatures: Signatures
) -> Iterator[contract.LiquidSpec]:
    if not assembly.liquid:
        return
    slopes = _liquid_slopes(assembly, signatures)
    signals = [
        (f"{m.name}.{s.name}", s) for m in plant.modules.values() for s in m.type.signals.values()
    ]
    follows = {name for name, s in signals if not s.is_input}
    for fault, change in liquids_of(plant.knowledge):
        for variant in fault.variants:
            id_ = liquid_id(change, variant.name)
            affects = assembly.liquid.get(id_, ())
            # All readings of its observers may leave the calibrated range.
            read = dict.fromkeys(s for o in affects for s in assembly.gradients[o] if s in follows)
            if affects:
                yield contract.LiquidSpec(
                    fault=_fault(fault, variant, id_, "", "", affects, tuple(read)),
                    cells=tuple(_liquid_cells(id_, residuals, signatures, slopes)),
                    sign=_sign_of(variant),
                    per_kelvin=change.per_kelvin,
                    factor=change.factor,
                    thermometers=tuple(n for n, s in signals if s.quantity == THERMOMETER),
                )


def _liquid_slopes(assembly: Assembly, signatures: Signatures) -> Mapping[tuple[str, str], float]:
    """Slope of each observer with the change undone, by fault and observer, at the reference."""
    outputs = {n: node for n, node in assembly.undo.outputs.items() if n.startswith("dql:")}
    plan = assembly.undo.plan(outputs)
    inputs: dict[str, float] = {n: 0.0 for n in plan.inputs if n.startswith("x:")}
    inputs |= {n: signatures.reference[n] for n in plan.inputs if n in signatures.reference}
    found = plan.run(inputs)
    parts = {name: name.split(":", 2) for name in outputs}
    return {(parts[n][2], parts[n][1]): float(np.ravel(value)[0]) for n, value in found.items()}


def _liquid_cells(
    fault: str,
    residuals: tuple[Residual, ...],
    signatures: Signatures,
    slopes: Mapping[tuple[str, str], float],
) -> Iterator[contract.Cell]:
    """Cells of the residuals that a change of the liquid moves by more than a negligible amount."""
    moved = {r.id: -sum(s * slopes.get((fault, o), 0.0) for s, o in r.terms) for r in residuals}
    finite = [abs(m) for m in moved.values() if math.isfinite(m)]
    least = LIQUID_SEEN * max(finite, default=0.0)
    for residual in residuals:
        slope = moved[residual.id]
        if not math.isfinite(slope) or abs(slope) <= least:
            continue
        detectable = threshold_of(signatures.uncertainties[residual.id]) / abs(slope)
        yield contract.Cell(
            fault,
            residual.id,
            1 if slope > 0.0 else -1,
            rounded(slope, DIGITS),
            rounded(slope, DIGITS),
            rounded(detectable, DIGITS),
            (),
            f"{residual} moves with the liquid",
        )


@functools.cache
def _sign_of(variant: Variant) -> int:
    x = sympy.Symbol("x", real=True)
    change = derivative(law_of(variant, sympy.S.One, x), x).subs(x, 0)
    return 1 if change > 0 else -1


def _parameters(plant: Plant) -> tuple[contract.ParameterSpec, ...]:
    return tuple(
        contract.ParameterSpec(
            f"{module.name}.{p.name}",
            p.unit.from_si(p.value),
            p.u / p.unit.factor,
            p.unit.text,
            _origin(p.origin),
        )
        for module in plant.modules.values()
        for p in module.parameters.values()
    )


def _origin(origin: Origin) -> str:
    where = f"{origin.file}:{origin.line}"
    return f"{where} ({origin.source})" if origin.source else where
