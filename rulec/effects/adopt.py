"""Adopt what a mismatch found: amended module types, recalibrated values, a new plant folder.

Instances of a type with the same amendments share the amended type. If they differ, those without
amendments keep the type, else the first ones do. Each other variant becomes a type of its own,
named after its first module.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from rulec.effects.candidate import TIME, Candidate, Repair, Unknown
from rulec.effects.flow_by_state import Gathering, held_back
from rulec.effects.limits import MAX_TYPE_STEM
from rulec.effects.model_builder import ModelBuilder
from rulec.effects.repair import AdoptRefused
from rulec.knowledge.fluid import reading_of
from rulec.knowledge.module_type import ModuleType, Parameter, Signal
from rulec.knowledge.plant import Module, Plant
from rulec.language.diagnostics import Origin
from rulec.language.units import Unit
from rulec.passes.amend import Amended
from rulec.passes.link import Network

NOT_PHYSICS = {
    "fault": "a fault is to be mended, not to be built into the model; rulec diagnose watches it",
    "sensor": "a sensor is to be mended or adjusted, not to be built into the model",
    "ageing": "what changes with time holds for this recording only",
    "free": "no physics stands behind it; outside this recording it may say anything",
}
"""Why explanations of these sorts are not written."""


@dataclass(frozen=True)
class Adopted:
    """An instance with its new type.

    `brought` are the parameters that its old type lacked, `inputs` their ids in the analysis.
    """

    module: Module
    type: ModuleType
    brought: Mapping[str, Parameter]
    inputs: Mapping[str, str]

    @property
    def changed(self) -> bool:
        """Does the new type differ from the old one?"""
        return bool(self.brought) or self.type.provides != self.module.type.provides


@dataclass(frozen=True)
class Adoption:
    """All instances of a plant, amended or not, and what was left out.

    `changed` maps each new type to its first instance, `left` lists ids of candidates with the
    reason.
    """

    plant: Plant
    instances: Mapping[str, Adopted]
    changed: Mapping[str, Adopted]
    taken: tuple[Candidate, ...]
    left: tuple[tuple[str, str], ...]


def adoption_of(builder: ModelBuilder, repair: Repair) -> Adoption:
    """The new types of all modules; raises `AdoptRefused` if the plant has changed since."""
    network = builder.network
    modules = network.plant.modules.values()
    known = {f"{m.name}.{name}" for m in modules for name in (*m.type.signals, *m.type.states)}
    for curve in repair.curves:
        location, driver = builder.location_by_id.get(curve.place), curve.driver
        if location is None or driver not in known or not location.may_follow(driver):
            message = f"a curve at '{curve.place}' does not fit {network.plant.name}"
            raise AdoptRefused(f"{message}; run rulec mismatch again")
    curves = map(builder.curve_term, repair.curves)
    by_id = {c.id: c for c in (*builder.candidates, *curves)}
    free = {s.id for s in builder.locations}
    _refuse_unknown(builder, repair)
    readings = Gathering(network)
    taken: list[Candidate] = []
    left: list[tuple[str, str]] = []
    for name in repair.joined:
        candidate = by_id.get(name)
        if candidate is None and name.split("[")[0] not in free:
            message = f"'{name}' does not fit {network.plant.name}; has it changed since?"
            raise AdoptRefused(f"{message} Run rulec mismatch again")
        reason = NOT_PHYSICS["free"] if candidate is None else why_not(candidate, network)
        if candidate is None or reason:
            left.append((name, reason))
        else:
            taken.append(candidate)
    ids = tuple(c.id for c in taken)
    instances = {
        module.name: _instance(
            network.plant,
            module,
            readings.written(module.name, builder.amended(module.name, ids)),
            taken,
            repair,
        )
        for module in modules
    }
    types = held_back(network, {name: own.type for name, own in instances.items()})
    instances = {name: replace(own, type=types[name]) for name, own in instances.items()}
    named = _named(instances, network.plant)
    changed: dict[str, Adopted] = {}
    for own in named.values():
        if own.changed:
            changed.setdefault(own.type.name, own)
    return Adoption(network.plant, named, changed, tuple(taken), tuple(left))


def _refuse_unknown(builder: ModelBuilder, repair: Repair) -> None:
    known = {*builder.parameters.ids, *(s.id for s in builder.locations)}
    known |= {u.id for c in builder.candidates for u in c.unknowns}
    for parameter in repair.parameters:
        if parameter.id.partition("#")[0] not in known:
            message = f"'{parameter.id}' is no parameter of this plant; has it changed since?"
            raise AdoptRefused(f"{message} Run rulec mismatch again")


def why_not(candidate: Candidate, network: Network) -> str:
    """Why a candidate cannot be written into a module type; empty if it can."""
    if candidate.sort in NOT_PHYSICS:
        return NOT_PHYSICS[candidate.sort]
    readings = Gathering(network)
    for source in map(reading_of, candidate.drivers.values()):
        if source == TIME:
            return "a module type knows no time"
        if not source.startswith(f"{candidate.module}.") and not readings.name(
            candidate.module, source
        ):
            return (
                f"a module type reads its own signals and sums over what lies downstream; "
                f"{source} is neither for {candidate.module}, so give its type a signal for it"
            )
    return ""


def _instance(
    plant: Plant, module: Module, amended: Amended, taken: list[Candidate], repair: Repair
) -> Adopted:
    """The instance with its amended type and the values found for its new parameters."""
    sources = {u.id: (c, u) for c in taken for u in c.unknowns}
    values, u = repair.values, {p.id: p.u for p in repair.parameters}
    brought = {}
    for local, input_ in amended.inputs.items():
        candidate, unknown = sources[input_]
        if input_ not in values:
            raise AdoptRefused(f"the repair has no value for '{input_}'; run rulec mismatch again")
        parameter = amended.type.parameters[local]
        source = (
            f"{candidate.source}; fitted to {repair.recording or 'a recording'} by rulec mismatch"
        )
        brought[local] = replace(
            parameter,
            value=values[input_],
            u=0.0 if unknown.fixed else u.get(input_, 0.0),
            unit=_shown_in(plant, parameter, unknown),
            origin=Origin(parameter.origin.file, parameter.origin.line, source),
        )
    kind = replace(
        amended.type,
        parameters={**amended.type.parameters, **brought},
        signals=_given(module.type, amended.type),
        states={
            n: s if n in module.type.states else replace(s, unit=_writable(plant, s.unit))
            for n, s in amended.type.states.items()
        },
    )
    return Adopted(module, kind, brought, amended.inputs)


def _given(plain: ModuleType, amended: ModuleType) -> dict[str, Signal]:
    """Signals; those that only the new physics reads become inputs."""
    groups = ("observers", "states", "readings")
    new = amended.reached(*groups) - plain.reached(*groups) - amended.readings.keys()
    return {
        name: replace(signal, is_input=signal.is_input or name in new)
        for name, signal in amended.signals.items()
    }


def _shown_in(plant: Plant, parameter: Parameter, unknown: Unknown) -> Unit:
    """A unit that a file may have; that of its signal or state for a typical reading."""
    if unknown.fixed and unknown.driver:
        module, _, name = reading_of(unknown.driver).partition(".")
        kind = plant.modules[module].type
        shown = kind.states.get(name) or kind.signals.get(name)
        if shown is not None and shown.unit.dimension == parameter.unit.dimension:
            return shown.unit
    return _writable(plant, parameter.unit)


def _writable(plant: Plant, unit: Unit) -> Unit:
    """The unit, or an SI unit if a file cannot have it."""
    try:
        return plant.knowledge.units.parse(unit.text)
    except ValueError:
        return plant.knowledge.units.plain(unit.dimension)


def _named(instances: Mapping[str, Adopted], plant: Plant) -> dict[str, Adopted]:
    """Types with names as the docstring of this file says."""
    groups: dict[str, dict[object, list[str]]] = {}
    for name, own in instances.items():
        equations = tuple((path, e.text) for path, e in own.type.equations_at())
        shape = equations, tuple(own.brought)
        groups.setdefault(own.module.type.name, {}).setdefault(shape, []).append(name)
    taken = set(plant.knowledge.modules) | groups.keys()
    result = dict(instances)
    for kind, shapes in groups.items():
        ordered = sorted(shapes.values(), key=lambda names: bool(instances[names[0]].brought))
        for i, names in enumerate(ordered):
            first = instances[names[0]]
            chosen, title = kind, first.type.title
            if i:
                chosen, title = fresh_type(f"{kind}-{names[0]}", taken), f"{title} ({names[0]})"
                taken.add(chosen)
            version = first.type.version + first.changed
            for name in names:
                own = instances[name]
                amended = replace(own.type, name=chosen, title=title, version=version)
                result[name] = replace(own, type=amended)
    return result


def fresh_type(name: str, taken: set[str]) -> str:
    """A type name that is not `taken`."""
    tried, count = name[:MAX_TYPE_STEM], 1
    while tried in taken:
        count += 1
        tried = f"{name[:MAX_TYPE_STEM]}-{count}"
    return tried
