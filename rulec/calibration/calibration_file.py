"""A calibration as data, in the form of its file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rulec.calibration.fit import ModuleFit
from rulec.effects.recalibrate import flow_entry, range_entry
from rulec.knowledge.plant import Module
from rulec.language.number_text import rounded
from rulec.passes.types import Compilation

DIGITS = 10
"""Significant digits in the file: enough for a covariance."""


def calibration_form(models: Compilation, fits: Sequence[ModuleFit]) -> dict[str, Any]:
    """The content of the calibration file, in the units of the module types."""
    plant = models.plant
    return {
        "calibration": plant.name,
        "modules": {fit.module: _entry(plant.modules[fit.module], fit) for fit in fits},
    }


def _entry(module: Module, fit: ModuleFit) -> dict[str, Any]:
    units = [module.type.parameters[n].unit for n in fit.parameters]
    factors = np.array([u.factor for u in units])
    spread = np.sqrt(np.diag(fit.covariance)) / factors
    entry: dict[str, Any] = {
        "type": module.type.name,
        "parameters": {
            name: {"value": rounded(u.from_si(v), DIGITS), "unit": u.text, "u": rounded(s, DIGITS)}
            for name, u, v, s in zip(fit.parameters, units, fit.values, spread, strict=True)
        },
        "covariance": [
            {
                "of": list(fit.parameters),
                "matrix": [
                    [rounded(v, DIGITS) for v in row]
                    for row in fit.covariance / np.outer(factors, factors)
                ],
            }
        ],
        "misfit": {},
        "range": {},
    }
    for observer in fit.observers:
        entry["misfit"][observer.observer] = {
            **flow_entry(observer.misfit),
            "r2": round(observer.r2, 6),
            "points": observer.points,
            "set_aside": observer.set_aside,
        }
    for name, found in fit.valid.items():
        entry["range"][name] = {
            **range_entry(module.type.signals[name].unit, found.low, found.high),
        }
        if found.unvaried:
            entry["range"][name]["source"] = (
                "the reading stood in the calibration; these are the 95 % bounds of its sensor"
            )
    return {key: value for key, value in entry.items() if value}
