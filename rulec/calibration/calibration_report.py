"""A calibration for the terminal, and as data in the form of its file."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.parts import Table, shown

from rulec.calibration.calibrate import Calibrated
from rulec.calibration.fit import ModuleFit
from rulec.effects.recalibrate import FLOW_FACTOR, block_entry, flow_entry, range_entry
from rulec.knowledge.plant import Module
from rulec.language.write_yaml import rounded
from rulec.passes.types import Compilation


def tell(out: Console, found: Calibrated, name: str, forced: bool) -> None:
    """Print the fit of each observer, what was left out, and remarks; `name` is that of the file.

    `forced`: it is written although a value is not credible.
    """
    for text in found.sensors:
        out.print(f"note: {text}")
    out.print(shown(_table(found)))
    for fit in found.fits:
        if untold := found.untold_of(fit):
            unvaried = fit.valid and all(reading.unvaried for reading in fit.valid.values())
            why = "only one operating point" if unvaried else "not determined by this recording"
            out.print(f"data-sheet value kept: {', '.join(untold)} ({why})", soft_wrap=True)
    for strain in found.strain:
        out.print(str(strain), markup=False, soft_wrap=True)
    if found.left_out:
        left = ", ".join(found.left_out)
        out.print(f"no true flow, or no readings of a law, left unchanged: {left}")
    for note in found.notes:
        out.print(f"note: {note}", markup=False, soft_wrap=True)
    made = f"from {found.points} {'operating points' if found.table else 'settled stretches'}"
    if not found.unbelievable:
        out.print(styled("[green]✓[/] {}: {}", name, made))
    elif forced:
        out.print(styled("[red]✗[/] {}: {}, against the sheet", name, made))
    else:
        far = ", ".join(strain.parameter for strain in found.unbelievable)
        out.print(styled("[red]✗[/] {} not written: {} too far from the sheet", name, far))
        out.print(
            "Ask rulec mismatch what is missing in the model, or correct the sheet or the columns. "
            "--force writes it.",
            markup=False,
            soft_wrap=True,
        )


def _table(found: Calibrated) -> Table:
    models, plant = found.models, found.models.plant
    rows = []
    for fit in found.fits:
        kind = plant.modules[fit.module].type
        units = {name: p.unit for name, p in kind.parameters.items()}
        values = dict(zip(fit.parameters, fit.values, strict=True))
        moved = [n for n in fit.parameters if f"{fit.module}.{n}" in found.moved]
        for o in fit.observers:
            expression = models.types[kind.key].observers[o.observer]
            used = [n for n in moved if n in {s.name for s in expression.free_symbols}]
            cells = (
                f"{fit.module}.{o.observer}",
                f"{o.misfit * FLOW_FACTOR:.3g}",
                f"{o.r2:.4f}",
                str(o.points),
                str(o.set_aside),
                ", ".join(
                    f"{n} {units[n].from_si(values[n]):.4g} {units[n].text}".removesuffix(" 1")
                    for n in used
                ),
            )
            rows.append(cells)
    titles = ("observer", ".misfit (l/h)", ".R2", ".points", ".set aside", "parameters")
    return Table(titles, rows)


DIGITS = 10
"""Significant digits of values in the file."""


def calibration_form(models: Compilation, fits: Sequence[ModuleFit]) -> dict[str, Any]:
    """The content of the calibration file, in the units of the module types."""
    plant = models.plant
    return {
        "calibration": plant.name,
        "modules": {fit.module: _entry(plant.modules[fit.module], fit) for fit in fits},
    }


def _entry(module: Module, fit: ModuleFit) -> dict[str, Any]:
    units = [module.type.parameters[n].unit for n in fit.parameters]
    spread = np.sqrt(np.diag(fit.covariance)) / np.array([u.factor for u in units])
    entry: dict[str, Any] = {
        "type": module.type.name,
        "parameters": {
            name: {"value": rounded(u.from_si(v), DIGITS), "unit": u.text, "u": rounded(s, DIGITS)}
            for name, u, v, s in zip(fit.parameters, units, fit.values, spread, strict=True)
        },
        "covariance": [block_entry(fit.parameters, units, fit.covariance)] if units else [],
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
