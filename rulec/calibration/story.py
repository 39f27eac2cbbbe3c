"""How good a calibration is, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import styled

from rulec.calibration.calibrate import Calibrated
from rulec.calibration.fit import ModuleFit
from rulec.effects.recalibrate import FLOW_FACTOR
from rulec.knowledge.plant import Module
from rulec.passes.types import Compilation


def tell(out: Console, found: Calibrated, name: str) -> None:
    """What each observer came to, what was left, and remarks; `name` is what came of it."""
    for text in found.sensors:
        out.print(f"note: {text}")
    out.print(_table(found.models, found.fits))
    if found.left_out:
        left = ", ".join(found.left_out)
        out.print(f"no true flow in this recording, left as they were: {left}")
    for note in found.notes:
        out.print(f"note: {note}", markup=False, soft_wrap=True)
    what = "operating points" if found.table else "settled stretches"
    out.print(styled("[green]✓[/] {}: from {} {}", name, found.points, what))


def _table(models: Compilation, fits: Sequence[ModuleFit]) -> Table:
    plant = models.plant
    table = Table(box=None, padding=(0, 2), pad_edge=False)
    for title in ("observer", "misfit (l/h)", "R2", "points", "set aside", "parameters"):
        table.add_column(title, justify="left" if title in ("observer", "parameters") else "right")
    for fit in fits:
        found = dict(zip(fit.parameters, fit.values, strict=True))
        for o in fit.observers:
            expression = models.types[plant.modules[fit.module].type.key].observers[o.observer]
            used = [n for n in found if n in {s.name for s in expression.free_symbols}]
            table.add_row(
                f"{fit.module}.{o.observer}",
                f"{o.misfit * FLOW_FACTOR:.3g}",
                f"{o.r2:.4f}",
                str(o.points),
                str(o.set_aside),
                ", ".join(_named(plant.modules[fit.module], n, found) for n in used),
            )
    return table


def _named(module: Module, name: str, found: Mapping[str, float]) -> str:
    unit = module.type.parameters[name].unit
    return f"{name} {unit.from_si(found[name]):.4g} {unit.text}"
