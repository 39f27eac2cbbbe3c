"""Effects for tests, written down briefly; the shipped ones stand in kb/effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from rulec.knowledge.effect import Driver, Effect, EffectLaw, EffectParameter, Join
from rulec.language.expression import parse
from rulec.language.origin import Origin
from rulec.language.units import UNKNOWN, Unit
from rulec.passes.types import Compilation


def join(
    law: str,
    *,
    gives: str = "",
    reads: str = "",
    falls_with: str = "",
    rises_with: str = "",
    measured: bool = False,
    substitutes: Mapping[str, Mapping[str, str]] | None = None,
) -> Join:
    """A join; `substitutes` is ``{"law_1": {"dp": "0"}}`` for a law with ``law_1`` in it."""
    table = {
        key: {driver: parse(by) for driver, by in replaced.items()}
        for key, replaced in (substitutes or {}).items()
    }
    return Join(
        reads=reads,
        gives=gives,
        falls_with=falls_with,
        rises_with=rises_with,
        measured=measured,
        law=EffectLaw(law, parse(law), table),
    )


def driver(quantity: str, where: str = "own") -> Driver:
    return Driver("", quantity, where, quantity)


def parameter(
    null: float | None = 0.0,
    lowest: float = -1e9,
    highest: float = 1e9,
    starts: tuple[float, ...] = (),
    of: str | None = None,
    fixed: bool = False,
    unit: str = "1",
) -> EffectParameter:
    return EffectParameter(
        name="",
        title="",
        unit=Unit(unit, 1.0, UNKNOWN),
        null=null,
        lowest=lowest,
        highest=highest,
        starts=starts,
        driver=of,
        fixed=fixed,
    )


def effect(
    name: str,
    *joins: Join,
    sort: str = "physics",
    drivers: Mapping[str, Driver] | None = None,
    parameters: Mapping[str, EffectParameter] | None = None,
    text: str = "{module}: {place}",
) -> Effect:
    return Effect(
        name=name,
        title=name.replace("-", " "),
        sort=sort,
        joins=joins,
        drivers={n: replace(d, name=n) for n, d in (drivers or {}).items()},
        parameters={n: replace(p, name=n, title=n) for n, p in (parameters or {}).items()},
        text=text,
        action="",
        origin=Origin("tests/effects.py", 1, "own"),
    )


WARM = effect(
    "warm-slip",
    join(
        "law_1 - (law_1 - law)*exp(b*(T - T0))",
        gives="volume flow",
        falls_with="dp",
        substitutes={"law_1": {"dp": "0"}},
    ),
    drivers={"dp": driver("pressure difference"), "T": driver("temperature", "plant")},
    parameters={
        "b": parameter(0.0, -0.02, 0.2, (0.02,), unit="1/K"),
        "T0": parameter(None, of="T", fixed=True, unit="K"),
    },
    text="{module}: the slip grows by {b} with {T}",
)
OFFSET = effect(
    "offset",
    join("law - a", reads="any"),
    sort="sensor",
    parameters={"a": parameter()},
)
LAMINAR = effect(
    "laminar-part",
    join("sqrt(law**2 + a**2/4) - a/2", gives="volume flow", rises_with="dp"),
    drivers={"dp": driver("pressure difference")},
    parameters={"a": parameter(0.0, 0.0, 1.0, unit="m3/s")},
)
CRACKING = effect(
    "cracking",
    join("law - p", gives="pressure difference", rises_with="dp", measured=True),
    drivers={"dp": driver("pressure difference")},
    parameters={"p": parameter(0.0, 0.0, 1e6, unit="Pa")},
)
SPEED = effect(
    "speed-loss",
    join(
        "law_1",
        gives="volume flow",
        falls_with="dp",
        substitutes={"law_1": {"n": "n*(1 - s*dp)"}},
    ),
    drivers={"dp": driver("pressure difference"), "n": driver("rotational speed")},
    parameters={"s": parameter(0.0, 0.0, 1.0, unit="1/Pa")},
)
WEAR = effect(
    "wear",
    join("law - c*t", gives="volume flow", falls_with="dp"),
    sort="ageing",
    drivers={"dp": driver("pressure difference"), "t": driver("time")},
    parameters={"c": parameter(unit="m3/s/s")},
)
HEADER = effect(
    "shared-header",
    join("law + k*F**2", gives="level", rises_with="Q", measured=False),
    drivers={"Q": driver("volume flow"), "F": driver("volume flow", "downstream")},
    parameters={"k": parameter()},
)
ALL = (WARM, OFFSET, LAMINAR, CRACKING, SPEED, WEAR, HEADER)


def with_effects(models: Compilation, *effects: Effect) -> Compilation:
    """Compilation whose knowledge has these effects and no others."""
    known = replace(models.plant.knowledge, effects={e.name: e for e in effects})
    plant = replace(models.plant, knowledge=known)
    return replace(models, plant=plant, network=replace(models.network, plant=plant))
