"""All effects by name, and the places of each in a plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from . import (
    bench_effects,
    connection_effects,
    line_effects,
    pump_effects,
    sensor_effects,
    unnamed_effects,
    valve_effects,
    wiring_effects,
)
from .effect import Effect
from .pumps import PUMPS
from .rig import Rig

EFFECTS: Mapping[str, Effect] = {
    effect.name: effect
    for group in (
        pump_effects,
        bench_effects,
        line_effects,
        sensor_effects,
        unnamed_effects,
        valve_effects,
    )
    for effect in group.EFFECTS
}

WIRING: Mapping[str, Effect] = {effect.name: effect for effect in wiring_effects.EFFECTS}
"""Mistakes of wiring and files: they have cases of their own and are no rivals of effects."""

CONNECTIONS: Mapping[str, Effect] = {e.name: e for e in connection_effects.EFFECTS}
"""Mistakes in the plant file, likewise."""


def effect_of(name: str) -> Effect:
    """Return an effect or a mistake by its name."""
    return {**EFFECTS, **WIRING, **CONNECTIONS}[name]


@dataclass(frozen=True)
class Placed:
    """An effect in a module."""

    effect: Effect
    module: str


def places_of(rig: Rig, effect: Effect) -> list[Placed]:
    """Return the possible places of an effect."""
    if effect.at == "mixer":
        return [Placed(effect, m) for m in rig.mixers]
    kinds = effect.kinds or tuple(kind for kind in PUMPS if kind != "valve")
    return [Placed(effect, m) for m, kind in rig.pumps.items() if kind in kinds]


def entry_of(name: str) -> Mapping[str, Any]:
    """Return the names of an effect or mistake in the catalogue, and its right places."""
    other = "connections.yaml" if name in CONNECTIONS else "wiring.yaml"
    found: Mapping[str, Any] = key("key.yaml" if name in EFFECTS else other)[name]
    return found


@cache
def key(file: str = "key.yaml") -> Mapping[str, Any]:
    """Read a key: each effect's names in the catalogue and its places."""
    text = (Path(__file__).parent / file).read_text(encoding="utf-8")
    found: Mapping[str, Any] = yaml.safe_load(text)
    return found
