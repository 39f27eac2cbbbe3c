"""Effects that an equation may lack: entries of the catalogue, checked, in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rulec.knowledge.module_type import Stored
from rulec.knowledge.shape import Shape
from rulec.language.expression import Expression
from rulec.language.origin import Origin
from rulec.language.units import Unit

PLAIN = "law"
"""Name of the plain law in the law of an effect."""


@dataclass(frozen=True)
class Driver:
    """A reading that an effect depends on, by quantity.

    `where` is ``own`` (a signal of the module), ``read`` (one that no state gives), ``unread`` (an
    own signal that no equation reads), ``beside`` (an own signal, if the equation of the place
    reads none of its quantity), ``plant`` (own, or else of any module) or ``downstream`` (a signal
    of the module behind, as in ``downstream(name)``). The quantity ``time`` means seconds since
    the beginning of the recording.
    """

    name: str
    quantity: str
    where: str
    title: str


@dataclass(frozen=True, kw_only=True)
class EffectParameter(Shape):
    """A parameter of an effect. One that is `fixed` stays at the median reading of `driver`.

    Where it is `of_place`, it is a reading of the signal that the effect joins, or per some unit
    such a difference: its numbers are in the unit of that signal, as often as `unit` says.
    """

    unit: Unit
    of_place: bool = False

    def at(self, reading: Unit, difference: Unit) -> EffectParameter:
        """The same at a signal, in SI; `difference` is the unit in which its readings differ."""
        if not self.of_place:
            return self
        unit = reading if self.null is None and self.unit.text == PLAIN else difference

        usual = self.usual
        if usual is not None and not usual.of_place:
            usual = replace(usual, size=usual.size * unit.factor)
        return replace(
            self,
            unit=Unit(
                unit.text + self.unit.text.removeprefix(PLAIN),
                unit.factor * self.unit.factor,
                unit.dimension * self.unit.dimension,
                unit.offset,
            ),
            lowest=unit.to_si(self.lowest),
            highest=unit.to_si(self.highest),
            starts=tuple(unit.to_si(start) for start in self.starts),
            usual=usual,
            of_place=False,
        )


@dataclass(frozen=True, kw_only=True)
class Join:
    """A kind of place that an effect can join, and the law it has there.

    One of these is set: `reads` (a signal of this quantity, ``any`` for all), `gives` (a definition
    or observer of this quantity), and in modules that store `stores` (the derivative of a state of
    this quantity), `shows` (what a sensor of this quantity shows, or ``any``), `flows` (``in`` or
    ``out``). `falls_with`, `rises_with` name a driver and the sign of the
    slope by it at the reference point; `measured` asks for places that read a signal of the very
    quantity they give (a processed reading), else those are left out. `steep`: a rise of that
    driver by a share changes what is given by more (True) or less (False) than half that share;
    None: either. A place that gives a flow counts only where an estimate of the module's flow
    rises with it: a slip, which is subtracted, is no estimate. `law` stands over ``law``,
    ``law(driver=...)``, drivers and parameters; only those that occur there, in `falls_with` and
    `rises_with`, or as the `driver` of such a parameter, are needed to join. `also` gives what
    flows ``in`` or ``out`` a law besides.
    """

    reads: str = ""
    gives: str = ""
    falls_with: str = ""
    rises_with: str = ""
    measured: bool = False
    law: EffectLaw
    steep: bool | None = None
    stores: str = ""
    shows: str = ""
    flows: str = ""
    also: Mapping[str, EffectLaw] = field(default_factory=dict)

    @property
    def laws(self) -> tuple[EffectLaw, ...]:
        """The law of the place, then those of further flows."""
        return (self.law, *self.also.values())


@dataclass(frozen=True)
class EffectLaw:
    """What a place becomes: `expression` over drivers, parameters, ``law`` and `substitutes`.

    ``law(dp=0)`` is read as the name of an entry of `substitutes`: which driver of the plain law
    is replaced by what.
    """

    text: str
    expression: Expression
    substitutes: Mapping[str, Mapping[str, Expression]]

    def names(self) -> set[str]:
        """Drivers and parameters that it speaks of, also where it asks for the plain law."""
        found = {name for name, _ in self.expression.names()} - {PLAIN, *self.substitutes}
        for replaced in self.substitutes.values():
            found |= replaced.keys()
            found |= {name for value in replaced.values() for name, _ in value.names()}
        return found


@dataclass(frozen=True, kw_only=True)
class EffectState(Stored):
    """Something that an effect stores, of the kind of its place; equations as in its law."""

    def names(self) -> set[str]:
        """Names in its equations."""
        return {name for _, e in self.equations() for name, _ in e.names()}


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Physics, ageing or a sensor error that a relation may leave out; `sort` says which."""

    name: str
    title: str
    sort: str
    joins: tuple[Join, ...]
    drivers: Mapping[str, Driver]
    parameters: Mapping[str, EffectParameter]
    text: str
    action: str
    origin: Origin
    states: Mapping[str, EffectState] = field(default_factory=dict)

    def used_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join speaks of, also by way of states."""
        found = {name for law in join.laws for name in law.names()}
        found |= {name for state in self.states.values() for name in state.names()}
        return found - {PLAIN, *self.states}

    def needed_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join needs, also for its slopes and as typical readings."""
        names = self.used_by(join) | {n for n in (join.falls_with, join.rises_with) if n}
        names |= {p.driver for n, p in self.parameters.items() if n in names and p.driver}
        return names - {PLAIN}
