"""Effects, faults and sensor errors, and the places of a plant where each may act.

Effects find places by their equations, never by name: a join asks for a dimension and for the sign
of a slope. The result is data for the analysis; each candidate comes with the change of the module
type that it represents.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from rulec.effects.binding import Binder, drivers_of, is_of_fluid, matching, thermometer
from rulec.effects.candidate import TIME, Candidate, Missing, Unknown
from rulec.effects.disturbance_locations import unit_of
from rulec.effects.equation_text import equation_of
from rulec.effects.onset import CLOCK, degree_unknown, with_onset
from rulec.effects.places import Site, Survey, sites_of, survey
from rulec.knowledge.effect import PLAIN, Effect, EffectParameter, Join
from rulec.knowledge.fluid import property_at, reading_of
from rulec.knowledge.module_type import ENDS, Parameter, State, Stored
from rulec.knowledge.plant import Module, Plant
from rulec.language.diagnostics import Origin
from rulec.language.expression import Rejected
from rulec.language.units import SECOND
from rulec.language.write_yaml import filled
from rulec.passes.amend import Amended, Change, amend
from rulec.passes.link import Network
from rulec.passes.put_balances import StoreFault, store_faults


@dataclass(frozen=True)
class Matched:
    """A candidate and the change of its module's type.

    One that acts alike in several modules has a change for each of them in `parts`.
    """

    candidate: Candidate
    change: Change
    parts: Mapping[str, Change] = field(default_factory=dict)

    def change_of(self, module: str) -> Change | None:
        """What it changes in a module; None if nothing."""
        own = self.change if module == self.candidate.module else None
        return self.parts.get(module, own)


@dataclass(frozen=True)
class Matches:
    """Candidates that fit some place of a plant, and those that lack one sensor."""

    around: Survey
    sites: Mapping[str, tuple[Site, ...]]
    candidates: tuple[Matched, ...]
    missing: tuple[Missing, ...]


def match_effects(network: Network, readings: Mapping[str, float]) -> Matches:
    """Match effects and faults to all modules; `readings` are at the reference point, SI."""
    around = survey(network, readings)
    binder = Binder(network)
    sites = {m.name: sites_of(around, m) for m in network.plant.modules.values()}
    found: list[Matched] = []
    missing: list[Missing] = []
    for module in network.plant.modules.values():
        matcher = _Matcher(around, binder, module, sites[module.name])
        found += matcher.faults()
        for effect in network.plant.knowledge.effects.values():
            found += matcher.joined(effect, missing)
    found += list(everywhere(found, network.plant))
    return Matches(around, sites, tuple(found), tuple(dict.fromkeys(missing)))


def everywhere(found: Iterable[Matched], plant: Plant) -> Iterator[Matched]:
    """Effects that several modules of a plant may share, with the same parameters.

    Physics that a module type lacks is missing in all of its instances, and a common header acts on
    all modules that feed it. Effects that depend on time alone belong to one module each.
    """
    groups: dict[tuple[object, ...], list[Matched]] = {}
    for matched in found:
        candidate, change = matched.candidate, matched.change
        if candidate.sort == "physics" and set(candidate.drivers.values()) != {TIME}:
            fixed = [u.driver for u in candidate.unknowns if u.fixed and u.driver is not None]
            own = any(reading_of(d).partition(".")[0] == candidate.module for d in fixed)
            # If a parameter refers to a typical reading of the module itself, only modules of the
            # same type are comparable.
            kind = plant.modules[candidate.module].type.key if own else ""
            key = (candidate.name, kind, change.places, change.law.text, *change.drivers.items())
            groups.setdefault(key, []).append(matched)
    for alike in groups.values():
        if len(alike) > 1:
            yield _common(alike)


def _common(alike: Sequence[Matched]) -> Matched:
    """One candidate for several modules, with the parameters of the first one."""
    first = alike[0].candidate
    id_ = f"{'+'.join(m.candidate.module for m in alike)}.{first.id.partition('.')[2]}"
    members = tuple(m.candidate.module for m in alike)
    observers = dict.fromkeys(o for m in alike for o in m.candidate.observers)
    ids = {name: f"{id_}.{name}" for name in alike[0].change.ids}
    candidate = replace(
        first,
        id=id_,
        observers=tuple(observers),
        unknowns=tuple(replace(u, id=f"{id_}.{u.name}") for u in first.unknowns),
        text=f"in {', '.join(members)} alike: {first.text}",
        members=members,
    )
    parts = {m.candidate.module: replace(m.change, ids=ids) for m in alike}
    return Matched(candidate, parts[first.module], parts)


class _Matcher:
    def __init__(
        self, around: Survey, binder: Binder, module: Module, sites: tuple[Site, ...]
    ) -> None:
        self._plant, self._stores = around.network.plant, around.network.stores
        self._binder, self._module = binder, module
        self._sites = {site.key: site for site in sites}

    def joined(self, effect: Effect, missing: list[Missing]) -> Iterator[Matched]:
        """Candidates of an effect; those that lack a reading are added to `missing`."""
        if effect.states and not self._stores:
            return
        taken: set[tuple[str, str]] = set()
        lacking: dict[str, list[Missing]] = {}
        knowledge = self._plant.knowledge
        for join in effect.joins:
            for site in matching(join, self._sites.values(), knowledge, self._module):
                if site.key in taken:
                    continue
                choices, lacks = self._binder.bindings(self._module.name, site, effect, join)
                if lacks:
                    asked = list(self._missing(effect, site, lacks))
                    before = lacking.setdefault(site.name, asked)
                    lacking[site.name] = min(before, asked, key=len)
                # Readings get the plain id, even if the fluid offers another driver.
                several = sum(not is_of_fluid(signals) for signals in choices) > 1
                for signals in choices:
                    named = several or is_of_fluid(signals)
                    made = self._candidate(effect, join, site, signals, named)
                    taken |= {site.key} if made else set()
                    yield from made
        # If another join fits without this reading, no sensor is asked for.
        joined = {name for _, name in taken}
        missing += [m for place, some in lacking.items() if place not in joined for m in some]

    def _missing(self, effect: Effect, site: Site, lacks: tuple[str, ...]) -> Iterator[Missing]:
        for name in lacks:
            quantity, fluid = effect.drivers[name].quantity, self._module.fluid
            if fluid is not None and quantity in fluid.properties:
                quantity = thermometer(self._plant.knowledge)
            yield Missing(
                name=effect.name,
                title=effect.title,
                module=self._module.name,
                place=site.name,
                quantity=quantity,
                sensor=cheapest_sensor(self._plant, quantity),
            )

    def _candidate(
        self, effect: Effect, join: Join, site: Site, signals: Mapping[str, str], named: bool
    ) -> list[Matched]:
        """The candidate, or none if its equation cannot be written there."""
        id_ = f"{self._module.name}.{effect.name}@{self._place(site)}"
        if named:
            id_ += f"({', '.join(signals.values())})"
        used, unit = effect.used_by(join), unit_of(self._plant, self._module, site)
        units = unit, self._plant.knowledge.units.difference(unit)
        parameters = {n: p.at(*units) for n, p in effect.parameters.items() if n in used}
        change = Change(
            places=(site.key,),
            law=join.law.expression,
            drivers={n: s for n, s in signals.items() if n in used},
            parameters={n: _parameter(p, effect.origin) for n, p in parameters.items()},
            ids={n: f"{id_}.{n}" for n in parameters},
            substitutes=join.law.substitutes,
            also=tuple((("end", f"{e}flow"), law.expression) for e, law in join.also.items()),
            states={
                n: self._state(n, state, site, effect.origin) for n, state in effect.states.items()
            },
            fluid=self._module.fluid,
        )
        drivers = {n: self._id(signals[n]) for n in drivers_of(join, effect)}
        read = {**drivers, PLAIN: self._id(site.name)}
        unknowns = tuple(_unknown(f"{id_}.{n}", p, read) for n, p in parameters.items())
        equation = self._equation(change, site.key)
        if equation is None:
            return []
        candidate = Candidate(
            id=id_,
            sort=effect.sort,
            name=effect.name,
            title=effect.title,
            module=self._module.name,
            place=site.name,
            observers=site.observers,
            unknowns=unknowns,
            drivers=drivers,
            equation=equation,
            text=self._text(effect.text, {**drivers, "place": site.name}),
            action=effect.action,
            source=effect.origin.source,
        )
        return [Matched(candidate, change)]

    def _state(self, name: str, state: Stored, site: Site, origin: Origin) -> State:
        """A state that an effect adds to a place, as a module type has it."""
        unit = unit_of(self._plant, self._module, site)
        if site.kind == "balance":
            unit = self._plant.knowledge.units.plain(unit.dimension / SECOND)
        title = f"delayed {site.name}"
        return State(name=name, quantity="", unit=unit, title=title, origin=origin, **vars(state))

    def _place(self, site: Site) -> str:
        """Name of a place, with its kind if an observer shares its name with a definition."""
        twin = site.kind == "observer" and ("definition", site.name) in self._sites
        return f"{site.name}.{site.kind}" if twin else site.name

    def _id(self, source: str) -> str:
        kind, (of_fluid, signal) = self._module.type, property_at(source)
        own = signal in (*kind.signals, *kind.states, *ENDS)
        id_ = f"{self._module.name}.{signal}" if own else signal
        return f"{of_fluid}({id_})" if of_fluid else id_

    def _equation(self, change: Change, place: tuple[str, str]) -> str | None:
        """The repaired equation; None if it cannot be written, as for a division by zero."""
        try:
            return equation_of(amend(Amended(type=self._module.type), change), place)
        except Rejected:
            return None

    def _text(self, text: str, slots: Mapping[str, str]) -> str:
        titles = [m.title for m in self._plant.modules.values()]
        unique = titles.count(self._module.title) == 1
        name = self._module.title if unique else self._module.name
        return filled(text, {"module": name, **slots})

    def faults(self) -> Iterator[Matched]:
        """Faults of the module: with a degree alone, or if the plant stores, also with an onset."""
        for fault in store_faults(self._module, self._plant.knowledge):
            degree = f"{fault.id}.x"
            change = replace(fault.change, ids={"x": degree})
            unknowns: tuple[Unknown, ...] = (degree_unknown(degree, fault.variant),)
            if self._stores:
                change, unknowns = with_onset(fault)
            equation = self._equation(change, change.places[0])
            if equation is not None:
                yield Matched(self._fault(fault, change, unknowns, equation), change)

    def _fault(
        self, fault: StoreFault, change: Change, unknowns: tuple[Unknown, ...], equation: str
    ) -> Candidate:
        """A fault as an explanation."""
        kind, place = fault.fault, change.places[0][1]
        sites = (self._sites.get(key) for key in change.places)
        found = dict.fromkeys(o for s in sites if s is not None for o in s.observers)
        slots = {"where": fault.target, "variant": fault.variant.title, "degree": "{x}"}
        return Candidate(
            id=fault.id,
            sort="fault",
            name=kind.name,
            title=kind.title_at(fault.target, fault.variant),
            module=self._module.name,
            place=place,
            observers=tuple(found) or (f"{self._module.name}.{place}",),
            unknowns=unknowns,
            drivers={CLOCK: TIME} if self._stores else {},
            equation=equation,
            text=self._text(kind.text, slots),
            action=kind.action,
            source=kind.origin.source,
        )


def cheapest_sensor(plant: Plant, quantity: str) -> str:
    """Title of the cheapest class of sensors for a quantity.

    Classes that the plant uses for the quantity come first, as they suit the liquid; then classes
    that declare the quantity. Without either, the text names the quantity alone.
    """
    signals = (s for m in plant.modules.values() for s in m.type.signals.values())
    own = {s.sensor for s in signals if s.quantity == quantity}
    classes = [
        (s.name not in own, s.cost, s.title)
        for s in plant.knowledge.sensors.values()
        if s.name in own or s.measures == quantity
    ]
    return min(classes, default=(False, 0.0, f"the {quantity}"))[2]


def _parameter(parameter: EffectParameter, origin: Origin) -> Parameter:
    """A parameter of an amended type; its value comes from the analysis."""
    return Parameter(
        name=parameter.name,
        value=parameter.null or 0.0,
        unit=parameter.unit,
        fit=not parameter.fixed,
        title=parameter.title,
        origin=origin,
        lowest=parameter.lowest,
        highest=parameter.highest,
    )


def _unknown(id_: str, parameter: EffectParameter, drivers: Mapping[str, str]) -> Unknown:
    shape, unit = dict(vars(parameter)), parameter.unit
    assert not shape.pop("of_place"), id_
    shape["unit"] = unit.text
    if parameter.driver:
        shape["driver"] = drivers[parameter.driver]
    return Unknown(id=id_, factor=unit.factor, offset=unit.offset, **shape)
