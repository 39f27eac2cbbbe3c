"""`rulec calibrate`: fit the parameters of a plant to a fault-free recording."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.table import Table
from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.point_table import NOTE, each_row, is_point_table
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.stationary import settle, systematic_u
from rulec_runtime.report.wording import KEPT, LEFT_OUT

from rulec.calibration.fit import CalibrationRefused, ModuleFit, Readings, fit_module
from rulec.calibration.notes import STOOD, notes_of
from rulec.calibration.true_flow import Local, true_flows
from rulec.effects.recalibrate import FLOW_FACTOR, flow_entry, range_entry
from rulec.knowledge.plant import Module
from rulec.language.written import rounded
from rulec.passes.differentiate import GATHERED
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation

DIGITS = 10
"""Significant digits in the file: enough for a covariance."""


def run(options: argparse.Namespace) -> int:
    """Fit, write the calibration file, show how good it is."""
    out = console(options)
    models = run_passes(Compilation(path=Path(options.plant)))
    ruleset = models.ruleset
    recording = read_recording(Path(options.recording), ruleset)
    health = examine(recording, ruleset, by_model=False)
    recording = health.recording
    for finding in health.findings:
        out.print(f"note: {finding.text}; {LEFT_OUT if finding.signal else KEPT}")
    table = is_point_table(recording, ruleset)
    stretches, noise = settle(recording, ruleset)
    if table:
        # One row says nothing of its own noise: that is part of the misfit.
        stretches, noise = each_row(recording), dict.fromkeys(noise, 0.0)
    if not len(stretches):
        raise CalibrationRefused(f"{options.recording}: no settled stretch was found")
    points = points_of_stretches(recording, ruleset, stretches, noise)
    fits = _fit_all(models, ruleset, points)
    data, plant = _file(models, fits), models.plant
    header = "# Written by rulec calibrate. Name it under 'calibration:' in plant.yaml.\n"
    write_text(Path(options.output), header + yaml.safe_dump(data, sort_keys=False, width=100))
    out.print(_table(models, fits))
    left = _left_out(models, fits)
    if left:
        out.print(f"no true flow in this recording, left as they were: {', '.join(left)}")
    notes = [note for fit in fits for note in notes_of(plant.modules[fit.module], fit)]
    notes += [NOTE] if table else []
    for note in notes:
        out.print(f"note: {note}", markup=False, soft_wrap=True)
    what = "operating points" if table else "settled stretches"
    out.print(styled("[green]✓[/] {}: from {} {}", options.output, len(stretches), what))
    write_json(options, {**data, "notes": notes})
    return 0


def _left_out(models: Compilation, fits: list[ModuleFit]) -> list[str]:
    """Modules with estimates of their own that were not fitted."""
    plant, fitted = models.plant, {fit.module for fit in fits}
    return [m.name for m in plant.modules.values() if m.type.observers and m.name not in fitted]


def _fit_all(models: Compilation, ruleset: Ruleset, points: Points) -> list[ModuleFit]:
    """Fit every module that ran and whose true flow is known; refuses if there is none."""
    plant = models.plant
    local = {m.name: _local(models, ruleset, points, m) for m in plant.modules.values()}
    flows = true_flows(models, local)
    fits = []
    for module in plant.modules.values():
        model = models.types[module.type.key]
        if module.name not in flows or all(o.is_reference for o in module.type.observers.values()):
            continue
        flow = flows[module.name]
        if not np.isfinite(flow.values).any():  # it stood all the time: what it was remains
            continue
        readings = Readings(local[module.name], flow)
        fits.append(fit_module(module, model, readings))
    if not fits:
        raise CalibrationRefused(
            "no module has a true flow to fit to: the recording needs a flow meter column, "
            "or a module type an observer with 'reference: true'"
        )
    return fits


def _local(models: Compilation, ruleset: Ruleset, points: Points, module: Module) -> Local:
    """Readings of a module, below-minimum ones blanked."""
    values: dict[str, Array] = {}
    systematic: dict[str, Array] = {}
    statistical: dict[str, Array] = {}
    for name in module.type.signals:
        signal = ruleset.signal_by_id[f"{module.name}.{name}"]
        if signal.id not in points.values:
            continue
        readings = points.values[signal.id].copy()
        if signal.minimum is not None:
            readings[~(readings >= signal.minimum)] = np.nan
        values[name] = readings
        systematic[name] = np.broadcast_to(systematic_u(signal, readings), readings.shape)
        statistical[name] = points.statistical(signal.id)
    n = len(next(iter(points.values.values())))
    for name in module.type.gathers:
        ids = [f"{m}.{s}" for m, s in models.network.gathers[module.name, name]]
        known = all(i in points.values for i in ids)
        parts = [points.values[i] for i in ids] if known else [np.full(n, np.nan)]
        shared = [systematic_u(ruleset.signal_by_id[i], points.values[i]) for i in ids if known]
        new = [points.statistical(i) for i in ids if known]
        values[GATHERED + name] = np.sum(parts, axis=0) if parts else np.zeros(n)
        systematic[GATHERED + name] = _root_of_squares(shared, n)
        statistical[GATHERED + name] = _root_of_squares(new, n)
    return Local(values, systematic, statistical)


def _root_of_squares(parts: Sequence[Array], n: int) -> Array:
    return np.sqrt(sum((np.broadcast_to(p, (n,)) ** 2 for p in parts), np.zeros(n)))


def _file(models: Compilation, fits: list[ModuleFit]) -> dict[str, Any]:
    """Content of the calibration file, in the units of the module types."""
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
            **({"source": STOOD} if found.stood else {}),
        }
    return {key: value for key, value in entry.items() if value}


def _table(models: Compilation, fits: list[ModuleFit]) -> Table:
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
