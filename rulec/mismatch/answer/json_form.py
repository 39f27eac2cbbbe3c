"""A comparison as JSON data, and the course of a hidden driver as a table."""

from __future__ import annotations

import math
from typing import Any

from rulec_runtime.output.csv_cell import row_of

from rulec.mismatch.inference.series import heldout_spans
from rulec.mismatch.result import (
    Estimate,
    Finding,
    Fit,
    HiddenDriver,
    Location,
    Mismatch,
    Region,
    Repair,
    SelfProof,
    Shape,
)


def mismatch_form(mismatch: Mismatch, plant_file: str, series: str | None = None) -> dict[str, Any]:
    """The comparison as JSON data; what is no finite number is None.

    Parameters
    ----------
    plant_file : of the plant as given, from which ``rulec adopt`` rebuilds the model.
    series : file with the course of the hidden driver, beside the JSON; None without one.
    """
    form: dict[str, Any] = {
        "plant": mismatch.plant,
        "recording": mismatch.recording,
        "recordings": [
            {**vars(part), "alone": [vars(likely) for likely in part.alone]}
            for part in mismatch.recordings
        ],
        "changed": [
            {**vars(update), "moved": [vars(moved) for moved in update.moved]}
            for update in mismatch.changed
        ],
        "verdict": mismatch.verdict,
        "headline": mismatch.headline,
        "locations": [_location(location) for location in mismatch.locations],
        "effects": [_finding(finding) for finding in mismatch.findings],
        "fit": _fit(mismatch.fit) if mismatch.fit is not None else None,
        "fits": [_fit(fit) for fit in mismatch.fits],
        "confounded": [vars(pair) for pair in mismatch.confounded],
        "strain": [{**vars(s), "distance": s.distance} for s in mismatch.strain],
        "hidden_driver": _hidden(mismatch.hidden, series) if mismatch.hidden else None,
        "untested": list(mismatch.untested),
        "next": mismatch.next,
        "split": {
            "text": mismatch.split,
            "hash": mismatch.digest,
            "heldout": _heldout(mismatch),
        },
        "evidence": [vars(part) for part in mismatch.evidence],
        "noise": mismatch.noise,
        "tried": mismatch.tried,
        "standing": [
            {**vars(one), "periods": [vars(period) for period in one.periods]}
            for one in mismatch.standing
        ],
        "notes": list(mismatch.notes),
        "repair": _repair(mismatch, plant_file),
        "seconds": mismatch.seconds,
    }
    if mismatch.power is not None:
        form["power"] = _power(mismatch.power)
    result: dict[str, Any] = _finite(form)
    return result


def _power(power: SelfProof) -> dict[str, Any]:
    return {
        "replays": power.replays,
        "nothing": {"called_missing": power.called_missing},
        "effects": [vars(seen) for seen in power.effects],
    }


def hidden_csv(hidden: HiddenDriver) -> str:
    """Course of a hidden driver; a cell is empty where it is unknown."""
    lines = [row_of(("time [s]", f"course [{hidden.unit}]"))]
    for time, value in zip(hidden.time, hidden.course, strict=True):
        lines.append(f"{time:.10g},{f'{value:.6g}' if math.isfinite(value) else ''}")
    return "\n".join(lines) + "\n"


def _heldout(mismatch: Mismatch) -> list[list[float]]:
    """Spans of time, s."""
    series = mismatch.series
    spans = heldout_spans(series.time, series.heldout) if series is not None else []
    return [list(span) for span in spans]


def _location(location: Location) -> dict[str, Any]:
    form = {**vars(location), "region": [_region(region) for region in location.region]}
    shape = form.pop("shape")
    return form if shape is None else {**form, **_shape(shape)}


def _shape(shape: Shape) -> dict[str, Any]:
    """The shape of what has no name; rows are driver, value and standard uncertainty."""
    return {
        "shape": {
            "driver": shape.driver,
            "driver_unit": shape.driver_unit,
            "unit": shape.unit,
            "points": [list(row) for row in zip(shape.at, shape.value, shape.u, strict=True)],
            "means": [list(row) for row in shape.means],
            "text": shape.text,
            "monotone": shape.monotone,
        },
        "memory": {"answer": shape.memory, "text": shape.memory_text},
        "beaten": [
            {
                "effect": beaten.effect,
                "title": beaten.title,
                "nats": beaten.nats,
                "region": None if beaten.region is None else _region(beaten.region),
            }
            for beaten in shape.beaten
        ],
    }


def _region(region: Region) -> dict[str, Any]:
    return {
        "variable": region.variable,
        "from": region.low,
        "to": region.high,
        "unit": region.unit,
        "share": region.share,
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "effect": finding.name,
        "id": finding.id,
        "sort": finding.sort,
        "title": finding.title,
        "module": finding.module,
        "modules": list(finding.members or (finding.module,)),
        "place": finding.place,
        "parameters": {name: _estimate(e) for name, e in finding.parameters.items()},
        "equation": finding.equation,
        "text": finding.text,
        "action": finding.action,
        "source": finding.source,
        "probability": finding.probability,
        "class_probability": finding.class_probability,
        "alternatives": [
            {
                "effect": a.name,
                "id": a.id,
                "title": a.title,
                "probability": a.probability,
                "same": a.same,
            }
            for a in finding.alternatives
        ],
        "gain": finding.gain,
        "rivals": [vars(rival) for rival in finding.rivals],
        "periods": [
            {"since": p.since, "until": p.until, "degree": p.degree, "u": p.u}
            | ({"unit": p.unit} if p.unit else {})
            | ({"grows": {**vars(p.growth), "per": "h"}} if p.growth else {})
            for p in finding.periods
        ],
        "closed": finding.closed,
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    """The title last."""
    form = dict(vars(estimate))
    title = form.pop("title")
    return {**form, "title": title}


def _fit(fit: Fit) -> dict[str, Any]:
    return {
        "signal": fit.signal,
        "unit": fit.unit,
        "relation": fit.relation,
        "simulated": fit.simulated,
        "estimation": vars(fit.estimation),
        "heldout": {**vars(fit.heldout), "gain_interval": list(fit.gain_interval)},
        "closed": fit.closed,
    }


def _hidden(hidden: HiddenDriver, series: str | None) -> dict[str, Any]:
    return {
        "text": hidden.text,
        "series": series,
        "module": hidden.module,
        "place": hidden.place,
        "unit": hidden.unit,
        "candidates": list(hidden.candidates),
        "sensor": hidden.sensor,
    }


def _repair(mismatch: Mismatch, plant_file: str) -> dict[str, Any]:
    """What ``rulec adopt`` rebuilds the repaired model from; numbers in SI.

    The id of an unknown is that of its candidate, a dot and its name. `recalibrated` holds the
    plain plant with other values alone, which can be written at any time.
    """
    plain, repair = mismatch.plain, mismatch.repair
    found = {finding.id: finding for finding in mismatch.findings}
    joined = []
    for name in repair.joined:
        finding, mark = found.get(name), f"{name}."
        joined.append(
            {
                "id": name,
                "effect": finding.name if finding else None,
                "module": finding.module if finding else None,
                "place": finding.place if finding else None,
                "unknowns": {p.id: p.value for p in repair.parameters if p.id.startswith(mark)},
                "fixed": {k: v for k, v in repair.fixed.items() if k.startswith(mark)},
            }
        )
    return {
        "plant": plant_file,
        "joined": joined,
        **_values(repair),
        "misread": [{"kind": m.kind, **vars(m.mending)} for m in mismatch.misread],
        "rewired": [vars(one) for one in mismatch.rewired],
        "left_out": [{"id": name, "reason": reason} for name, reason in mismatch.left_out],
        "refused": mismatch.refused or None,
        "checks": [vars(check) for check in mismatch.checks],
        "recalibrated": None if plain is None else _values(plain),
    }


def _values(found: Repair) -> dict[str, Any]:
    """Values of a plant that can be written, SI."""
    return {
        "parameters": [p.id for p in found.parameters],
        "values": [p.value for p in found.parameters],
        "covariance": [[float(value) for value in row] for row in found.covariance],
        "misfit": dict(found.misfit),
        "range": {name: list(ends) for name, ends in found.ranges.items()},
    }


def _finite(data: Any) -> Any:
    """The same data, None in the place of numbers that JSON has no word for."""
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float) or hasattr(data, "dtype"):
        number = data.item() if hasattr(data, "item") else data
        return None if isinstance(number, float) and not math.isfinite(number) else number
    return data
