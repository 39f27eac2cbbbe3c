"""Effects that an equation may leave out: checked entries of the catalogue, in SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rulec.knowledge.module_type import Stored
from rulec.knowledge.shape import Shape
from rulec.language.expression import Expression
from rulec.language.origin import Origin
from rulec.language.units import Unit

PLAIN = "law"
"""Name of the plain law, without the effect, in the law of an effect."""


@dataclass(frozen=True)
class Driver:
    """A reading that an effect depends on, by quantity.

    `where` is ``own`` (a signal of the module), ``read`` (an own signal that no state gives),
    ``unread`` (an own signal that no equation reads), ``beside`` (an own signal, if the equation
    of the place reads none of its quantity), ``plant`` (an own signal, else one of any module) or
    ``downstream`` (a signal of the next module, as in ``downstream(name)``). The quantity ``time``
    means seconds since the start of the recording.
    """

    name: str
    quantity: str
    where: str
    title: str


@dataclass(frozen=True, kw_only=True)
class EffectParameter(Shape):
    """A parameter of an effect; a `fixed` one stays at the median reading of `driver`.

    One `of_place` is a reading of the signal that the effect joins, or a difference of its readings
    per some unit: its numbers are in the unit of that signal, times `unit`.
    """

    unit: Unit
    of_place: bool = False

    def at(self, reading: Unit, difference: Unit) -> EffectParameter:
        """The parameter at a signal, in SI; `difference` is the unit of differences of readings."""
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
    """A kind of place that an effect can join, and its law there.

    Exactly one of these is set: `reads` (a signal of this quantity, or ``any``), `gives` (a
    definition or observer of this quantity), and in modules that store, `stores` (the derivative of
    a state of this quantity), `shows` (what a sensor of this quantity shows, or ``any``), `flows`
    (``in`` or ``out``).

    `falls_with` and `rises_with` name a driver; the slope by it at the reference point must have
    that sign. `steep`: if that driver rises by a share, the result changes by more (True) or less
    (False) than half that share; None: either. With `measured`, only places that read a signal of
    the quantity they give (a processed reading) are joined; without it, only others. A place that
    gives a flow is joined only if an estimate of the module's flow rises with it: a slip, which is
    subtracted, is no estimate.

    `law` may use ``law``, ``law(driver=...)``, drivers and parameters. A join needs only those that
    occur there, in `falls_with` or `rises_with`, or as the `driver` of such a parameter. `also`
    gives the flow ``in`` or ``out`` a law in addition.
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
        """The law of the place, then those of `also`."""
        return (self.law, *self.also.values())


@dataclass(frozen=True)
class EffectLaw:
    """The law of a place: `expression` over drivers, parameters, ``law`` and `substitutes`.

    Each distinct ``law(dp=0)`` is the name of an entry of `substitutes`, which maps drivers of the
    plain law to what replaces them.
    """

    text: str
    expression: Expression
    substitutes: Mapping[str, Mapping[str, Expression]]

    def names(self) -> set[str]:
        """Drivers and parameters that it uses, including those in ``law(...)``."""
        found = {name for name, _ in self.expression.names()} - {PLAIN, *self.substitutes}
        for replaced in self.substitutes.values():
            found |= replaced.keys()
            found |= {name for value in replaced.values() for name, _ in value.names()}
        return found


@dataclass(frozen=True, kw_only=True)
class EffectState(Stored):
    """A state of an effect, of the dimension of its place; equations may use what its law may."""

    def names(self) -> set[str]:
        """Names in its equations."""
        return {name for _, e in self.equations() for name, _ in e.names()}


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Physics, ageing or a sensor error (`sort`) that a relation may leave out."""

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
        """Drivers and parameters that a join uses, directly or through states."""
        found = {name for law in join.laws for name in law.names()}
        found |= {name for state in self.states.values() for name in state.names()}
        return found - {PLAIN, *self.states}

    def needed_by(self, join: Join) -> set[str]:
        """Drivers and parameters that a join uses or needs for its slopes or typical readings."""
        names = self.used_by(join) | {n for n in (join.falls_with, join.rises_with) if n}
        names |= {p.driver for n, p in self.parameters.items() if n in names and p.driver}
        return names - {PLAIN}
