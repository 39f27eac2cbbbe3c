"""How plants are driven: steps and ramps of what is given, slow temperatures, levels that fall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array

from tests.conftest import ROOT

MINUTE, BAR, RPM, KELVIN = 60.0, 1e5, 1 / 60, 273.15


@dataclass(frozen=True)
class Rig:
    """A plant and the ranges, SI, over which it is driven.

    `steps` are given signals that are set anew every 10 to 30 s, each on its own. `loads` are given
    signals that are set likewise, as share of what the first of the steps allows. `warm` is the
    range of all temperatures (`viscous` follow from them), `constant` what is held.
    """

    file: Path
    steps: Mapping[str, tuple[float, float]]
    loads: Mapping[str, tuple[float, float]]
    warm: Mapping[str, tuple[float, float]]
    viscous: tuple[str, ...] = ()
    levels: tuple[str, ...] = ()
    constant: Mapping[str, float] | None = None


def _dosing(*modules: str) -> dict[str, tuple[float, float]]:
    return {f"{m}.n": (270 * RPM, 1080 * RPM) for m in modules}


def _warm(*modules: str) -> dict[str, tuple[float, float]]:
    return {f"{m}.T": (KELVIN + 18, KELVIN + 42) for m in modules}


PLANTS = ROOT / "plants"

RIGS = {
    "abc": Rig(
        PLANTS / "abc",
        _dosing("A", "B"),
        {},
        _warm("A", "B"),
        (),
        ("A.l", "B.l"),
    ),
    "zema": Rig(
        PLANTS / "zema-hydraulic",
        {"main.dp": (142 * BAR, 166 * BAR)},
        {},
        {"main.T": (KELVIN + 36, KELVIN + 57)},
    ),
    "esp": Rig(
        PLANTS / "esp-pump" / "p37.yaml",
        {"pump.n": (1820 * RPM, 3480 * RPM)},
        {"pump.Q": (4 / 3600, 38 / 3600)},
        {"pump.T": (KELVIN + 22, KELVIN + 50)},
        ("pump.mu",),
        (),
        {"pump.rho": 996.0},
    ),
    "rig": Rig(
        PLANTS / "mixing-rig",
        {
            **{f"{m}.n": (420 * RPM, 1250 * RPM) for m in "ABC"},
            "D.n": (65 * RPM, 155 * RPM),
            "E.n": (2300 * RPM, 2950 * RPM),
        },
        {},
        _warm(*"ABCDE"),
        (),
        tuple(f"{m}.l" for m in "ABCDE"),
    ),
}


def course(rig: Rig, samples: int, random: np.random.Generator) -> dict[str, Array]:
    """Given signals of a recording with one sample per second, each shape (samples,), SI."""
    found: dict[str, Array] = {}
    for name, (low, high) in rig.steps.items():
        found[name] = low + (high - low) * _steps(samples, random)
    driven = next(iter(rig.steps))
    share = found[driven] / rig.steps[driven][1]
    for name, (low, high) in rig.loads.items():
        found[name] = share * (low + (high - low) * _steps(samples, random))
    weather = _slow(samples, random)
    for name, (low, high) in rig.warm.items():
        mixed = 0.5 * weather + 0.5 * _slow(samples, random)
        found[name] = low + (high - low) * mixed
    for name, temperature in zip(rig.viscous, rig.warm, strict=False):
        found[name] = 0.02 * np.exp(-0.05 * (found[temperature] - KELVIN - 25))
    for name in rig.levels:
        period = random.uniform(0.2, 0.6) * samples
        phase = (np.arange(samples) / period + random.uniform()) % 1.0
        found[name] = 0.9 - 0.75 * phase
    for name, value in (rig.constant or {}).items():
        found[name] = np.full(samples, value)
    return found


def _steps(samples: int, random: np.random.Generator) -> Array:
    """Levels between 0 and 1, held for 10 to 30 samples, now and then with a ramp between."""
    shares = np.empty(samples)
    at, level = 0, float(random.uniform())
    while at < samples:
        until = min(at + int(random.integers(10, 31)), samples)
        shares[at:until] = level
        at, before, level = until, level, float(random.uniform())
        if random.uniform() < 0.15 and at < samples:
            until = min(at + int(random.integers(10, 41)), samples)
            shares[at:until] = np.linspace(before, level, until - at)
            at = until
    return shares


def _slow(samples: int, random: np.random.Generator) -> Array:
    """A warm-up and a swing as of day and night, between 0 and 1."""
    time = np.arange(samples) / samples
    warm = 1.0 - np.exp(-time / random.uniform(0.1, 0.4))
    swing = np.sin(2 * np.pi * (random.uniform(0.8, 2.0) * time + random.uniform()))
    raw = warm + random.uniform(0.3, 0.8) * swing
    shown: Array = (raw - raw.min()) / np.ptp(raw)
    return shown
