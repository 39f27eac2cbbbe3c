"""Pass 11, emit: everything the runtime needs, as data."""

from __future__ import annotations

import math

import rulec_runtime.contract.ruleset as contract

from rulec.knowledge.knowledge import FaultType, Variant
from rulec.knowledge.module_type import Signal
from rulec.knowledge.plant import Module, Plant
from rulec.language.origin import Origin
from rulec.passes.analyse_isolability import Group, Isolability
from rulec.passes.assemble import Assembly, Hypothesis
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_rules import Rule
from rulec.passes.derive_signatures import Signatures
from rulec.passes.link import Network
from rulec.passes.put_balances import Balanced
from rulec.passes.store_faults import StoreFault


def emit(
    network: Network,
    residuals: tuple[Residual, ...],
    assembly: Assembly,
    signatures: Signatures,
    rules: tuple[Rule, ...],
    isolability: Isolability,
    simulation: contract.Simulation,
    balanced: Balanced,
) -> contract.Ruleset:
    """Write the ruleset of a plant. The same sources always give the same ruleset.

    >>> from rulec.passes.pipeline import example
    >>> ruleset = example("ruleset").ruleset
    >>> len(ruleset.residuals), len(ruleset.faults), len(ruleset.cells)
    (9, 18, 76)
    """
    plant = network.plant
    return contract.Ruleset(
        contract.FORMAT_VERSION,
        plant.name,
        plant.title,
        plant.digest,
        {m.name: m.title for m in plant.modules.values()},
        _signals(plant, signatures),
        tuple(contract.ColumnMap(c.signal, c.column, c.factor, c.offset) for c in plant.columns),
        plant.time_column,
        {
            name: contract.UnitSpec(u.factor, u.offset, tuple(map(float, u.dimension.exponents)))
            for name, u in plant.knowledge.units.units.items()
        },
        _observers(plant, assembly, signatures),
        tuple(contract.Junction(b.outlets, b.inlets) for b in network.balances),
        tuple(
            contract.ResidualSpec(
                r.id,
                r.module,
                tuple(contract.Term(o, s) for s, o in r.terms),
                str(r),
                _rounded(signatures.uncertainties[r.id]),
            )
            for r in residuals
        ),
        (
            *(_fault(h) for h in assembly.hypotheses),
            *(_of_store(f) for f in balanced.faults if not f.settled),
        ),
        tuple(
            contract.Cell(
                rule.signature.fault,
                rule.signature.residual,
                rule.signature.sign,
                _rounded(rule.signature.gain),
                _rounded(rule.signature.sensitivity),
                _rounded(rule.signature.detectable),
                rule.forms,
                rule.equation,
            )
            for rule in rules
        ),
        tuple(_ambiguous(group) for group in isolability.groups),
        _unobserved(isolability.unobserved, balanced),
        _parameters(plant),
        simulation,
        assembly.graph.plan(),
        assembly.undo.plan(),
        balanced.dynamics,
    )


def _signals(plant: Plant, signatures: Signatures) -> tuple[contract.SignalSpec, ...]:
    return tuple(
        _signal(plant, module, signal, signatures.reference[f"{module.name}.{signal.name}"])
        for module in plant.modules.values()
        for signal in module.type.signals.values()
    )


def _signal(plant: Plant, module: Module, signal: Signal, reference: float) -> contract.SignalSpec:
    sensor = plant.knowledge.sensors[signal.sensor]
    low, high = module.valid.get(signal.name, (None, None))
    return contract.SignalSpec(
        f"{module.name}.{signal.name}",
        f"{signal.quantity} of {module.title}",
        signal.unit.text,
        signal.unit.factor,
        signal.unit.offset,
        sensor.kind,
        sensor.standard,
        signal.full_scale,
        signal.lowest,
        signal.highest,
        signal.minimum,
        low,
        high,
        signal.is_input,
        _rounded(reference, 12) if reference == reference else 0.0,
        signal.between,
    )


def _observers(
    plant: Plant, assembly: Assembly, signatures: Signatures
) -> tuple[contract.ObserverSpec, ...]:
    signals = {f"{m.name}.{s}" for m in plant.modules.values() for s in m.type.signals}
    result = []
    for module in plant.modules.values():
        for observer in module.type.observers.values():
            key = f"{module.name}.{observer.name}"
            guards = assembly.guards[key]
            result.append(
                contract.ObserverSpec(
                    key,
                    module.name,
                    observer.component,
                    f"{key} = {observer.expression}",
                    tuple(sorted(n for n in assembly.gradients[key] if n in signals)),
                    tuple(
                        contract.Guard(f"guard:{key}:{i}", text)
                        for i, (text, _) in enumerate(guards)
                    ),
                    module.misfit.get(observer.name, 0.0),
                    _rounded(signatures.flows[key]),
                    _origin(observer.origin),
                )
            )
    return tuple(result)


def _fault(hypothesis: Hypothesis) -> contract.FaultSpec:
    fault = hypothesis.fault
    return _spec(hypothesis, fault.fault, fault.variant, hypothesis.affects, hypothesis.scales)


def _of_store(fault: StoreFault) -> contract.FaultSpec:
    """A fault that balances alone know; it touches no estimate of a settled flow."""
    scales = (fault.target,) if fault.fault.acts_on == "signal" else ()
    return _spec(fault, fault.fault, fault.variant, (), scales)


def _spec(
    where: Hypothesis | StoreFault,
    fault: FaultType,
    variant: Variant,
    affects: tuple[str, ...],
    scales: tuple[str, ...],
) -> contract.FaultSpec:
    return contract.FaultSpec(
        where.id,
        where.module,
        fault.name,
        f"{where.target} {variant.title}" if variant.name else fault.title,
        _sentence(fault.text, where.module, where.target, variant),
        fault.action,
        fault.status,
        float(variant.lowest),
        float(variant.highest),
        float(fault.tolerance),
        variant.meaning,
        affects,
        scales,
        fault.acts_on == "signal",
        _origin(fault.origin),
        variant.unit,
    )


def _ambiguous(group: Group) -> contract.AmbiguousGroup:
    return contract.AmbiguousGroup(
        group.faults,
        group.kind,
        group.advice,
        tuple(_rounded(d, 4) if math.isfinite(d) else None for d in group.degrees),
        tuple(contract.AdvisedSensor(s.module, s.signal, s.cost) for s in group.sensors),
    )


def _unobserved(names: tuple[str, ...], balanced: Balanced) -> tuple[str, ...]:
    """Modules and faults that neither estimates nor balances see."""
    seen = balanced.dynamics.faults if balanced.dynamics is not None else ()
    return tuple(name for name in names if name not in seen)


def _rounded(value: float, digits: int = 9) -> float:
    """Fewer digits than a solver's last ones: the same bytes on every machine."""
    return float(f"{value:.{digits}g}")


def _sentence(text: str, module: str, target: str, variant: Variant) -> str:
    """The operator's sentence with all slots filled but the degree."""
    slots = {"{module}": module, "{where}": target, "{variant}": variant.title}
    for slot, value in slots.items():
        text = text.replace(slot, value)
    return text


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
