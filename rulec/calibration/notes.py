"""Notes on a calibration for the user: contradictions and readings that did not vary."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rulec.calibration.fit import ModuleFit
from rulec.knowledge.module_type import Parameter
from rulec.knowledge.plant import Module
from rulec.limits import FAR_OFF, OTHER_SIZE

STOOD = "the reading stood in the calibration; these are the 95 % bounds of its sensor"


def notes_of(module: Module, fit: ModuleFit) -> Iterator[str]:
    """Notes on contradictions to the data sheet, and on readings that were not varied."""
    yield from _implausible(module, fit)
    for observer in fit.observers:
        if observer.contradicts:
            yield (
                f"{fit.module}.{observer.observer}: the recording contradicts the data sheet, "
                "which was left out here; if the data sheet is right, something is missing in the "
                "model or a sensor is wrong"
            )
    for name, found in fit.valid.items():
        if found.stood:
            unit = module.type.signals[name].unit
            low, high = (f"{unit.from_si(end):.4g}" for end in (found.low, found.high))
            yield (
                f"{fit.module}.{name} stood all the time, as far as its sensor can tell; the laws "
                f"count as tested from {low} to {high} {unit.text} alone, and beyond that no fault "
                "is named. Vary it in the calibration if it varies in operation"
            )


def _implausible(module: Module, fit: ModuleFit) -> Iterator[str]:
    """Values far from what the data sheet says."""
    for i, (name, value) in enumerate(zip(fit.parameters, fit.values.tolist(), strict=True)):
        stated, u = module.stated[name], math.sqrt(fit.covariance[i, i])
        if _is_far(stated, value, u):
            unit = stated.unit
            said = f"{unit.from_si(stated.value):.4g}"
            if stated.u:
                said += f" ± {stated.u / unit.factor:.2g}"
            yield (
                f"{fit.module}.{name}: the recording says {unit.from_si(value):.4g} {unit.text}, "
                f"the data sheet {said} {unit.text}; check the units of the columns and the "
                "equation of the flow meter before this file is used"
            )


def _is_far(stated: Parameter, value: float, u: float) -> bool:
    off = abs(value - stated.value)
    if stated.u and off > FAR_OFF * math.hypot(stated.u, u):
        return True
    zero = stated.unit.offset
    old, new = abs(stated.value - zero), abs(value - zero)
    other = old > 0 and not old / OTHER_SIZE <= new <= old * OTHER_SIZE
    return other and off > FAR_OFF * u
