"""Notes on a calibration for the user: values far from the data sheet, readings that stood."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rulec.calibration.fit import ModuleFit
from rulec.knowledge.plant import Module
from rulec.limits import FAR_OFF, OTHER_SIZE

STOOD = "the reading stood in the calibration; these are the 95 % bounds of its sensor"


def notes_of(module: Module, fit: ModuleFit) -> Iterator[str]:
    """Notes on values of another size than stated, and on readings that were not varied."""
    yield from _implausible(module, fit)
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
    """Values of another size than a data sheet says that states no uncertainty."""
    u = np.sqrt(np.diag(fit.covariance)).tolist()
    for name, value, error in zip(fit.parameters, fit.values.tolist(), u, strict=True):
        stated = module.stated[name]
        unit = stated.unit
        old, new = abs(stated.value - unit.offset), abs(value - unit.offset)
        alike = not old or old / OTHER_SIZE <= new <= old * OTHER_SIZE
        if not stated.u and not alike and abs(value - stated.value) > FAR_OFF * error:
            yield (
                f"{fit.module}.{name}: the recording says {unit.from_si(value):.4g} {unit.text}, "
                f"the data sheet {unit.from_si(stated.value):.4g} {unit.text}; check the units of "
                "the columns and the equation of the flow meter before this file is used"
            )
