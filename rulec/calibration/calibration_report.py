"""How good a calibration is, for the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import styled

from rulec.calibration.calibrate import Calibrated
from rulec.effects.recalibrate import FLOW_FACTOR


def tell(out: Console, found: Calibrated, name: str, forced: bool) -> None:
    """Print the fit of each observer, what was left out, and remarks; `name` is that of the file.

    `forced`: it is written although a value is not credible.
    """
    for text in found.sensors:
        out.print(f"note: {text}")
    out.print(_table(found))
    for fit in found.fits:
        if untold := found.untold_of(fit):
            unvaried = fit.valid and all(reading.unvaried for reading in fit.valid.values())
            why = "only one operating point" if unvaried else "not determined by this recording"
            out.print(f"data-sheet value kept: {', '.join(untold)} ({why})", soft_wrap=True)
    for strain in found.strain:
        out.print(str(strain), markup=False, soft_wrap=True)
    if found.left_out:
        left = ", ".join(found.left_out)
        out.print(f"no true flow in this recording, left unchanged: {left}")
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
    table = Table(box=None, padding=(0, 2), pad_edge=False)
    for title in ("observer", "misfit (l/h)", "R2", "points", "set aside", "parameters"):
        table.add_column(title, justify="left" if title in ("observer", "parameters") else "right")
    for fit in found.fits:
        kind = plant.modules[fit.module].type
        units = {name: p.unit for name, p in kind.parameters.items()}
        values = dict(zip(fit.parameters, fit.values, strict=True))
        moved = [n for n in fit.parameters if f"{fit.module}.{n}" in found.moved]
        for o in fit.observers:
            expression = models.types[kind.key].observers[o.observer]
            used = [n for n in moved if n in {s.name for s in expression.free_symbols}]
            table.add_row(
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
    return table
