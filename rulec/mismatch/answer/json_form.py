"""A comparison as JSON data, and the course of a hidden driver as a table."""

import math
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np
from rulec_runtime.output.csv_cell import row_of

from rulec.mismatch.inference.heldout_errors import heldout_spans
from rulec.mismatch.result import (
    Alternative,
    Finding,
    Fit,
    LatentInput,
    Location,
    Mismatch,
    Period,
    Region,
    Repair,
    SelfProof,
    Shape,
)

SAME = (
    *("plant", "recording", "recordings", "changed", "verdict", "headline", "locations", "fit"),
    *("fits", "confounded", "untested", "next", "evidence", "noise", "tried", "standing", "notes"),
    "seconds",
)
"""Fields of `Mismatch` whose JSON key is their name."""


def mismatch_form(mismatch: Mismatch, plant_file: str, series: str | None = None) -> dict[str, Any]:
    """The comparison as JSON data; numbers that are not finite are None.

    Parameters
    ----------
    plant_file : the plant file as given, from which ``rulec adopt`` rebuilds the model.
    series : file with the course of the hidden driver, beside the JSON; None without one.
    """
    courses, power = mismatch.series, mismatch.power
    spans = heldout_spans(courses.time, courses.heldout) if courses is not None else []
    latent = None
    if mismatch.latent_input:
        latent = _renamed(mismatch.latent_input, time="", course="", switches="")
        latent["series"] = series
    form = {name: getattr(mismatch, name) for name in SAME} | {
        "effects": mismatch.findings,
        "strain": [{**vars(s), "distance": s.distance} for s in mismatch.strain],
        "hidden_driver": latent,
        "split": {"text": mismatch.split, "hash": mismatch.digest, "heldout": spans},
        "repair": _repair(mismatch, plant_file),
    }
    result = {key: _form(value) for key, value in form.items()}
    return result | ({} if power is None else {"power": power_form(power)})


def power_form(power: SelfProof) -> dict[str, Any]:
    """The results of replays as JSON data."""
    nothing = {"called_missing": power.called_missing}
    form = {"replays": power.replays, "nothing": nothing, "effects": power.effects}
    return {key: _form(value) for key, value in form.items()}


def latent_csv(latent: LatentInput) -> str:
    """Course of a hidden driver; a cell is empty if its value is unknown."""
    lines = [row_of(("time [s]", f"course [{latent.unit}]"))]
    for time, value in zip(latent.time, latent.course, strict=True):
        lines.append(f"{time:.10g},{f'{value:.6g}' if math.isfinite(value) else ''}")
    return "\n".join(lines) + "\n"


def _form(data: Any) -> Any:
    """Data as JSON; a dataclass by its fields unless listed here."""
    match data:
        case Region():
            data = _renamed(data, low="from", high="to")
        case Alternative():
            data = _renamed(data, name="effect")
        case Location(shape=None):
            data = _renamed(data, shape="")
        case Location(shape=Shape() as shape):
            data = _renamed(data, shape="") | _shape(shape)
        case Fit():
            heldout = {**vars(data.heldout), "gain_interval": data.gain_interval}
            data = _renamed(data, gain_interval="") | {"heldout": heldout}
        case Finding():
            data = _renamed(data, name="effect", members="", shapeless="") | {
                "modules": data.members or (data.module,),
                "class_probability": data.class_probability,
            }
        case Period(growth=growth):
            # Keys that most periods would leave empty are left out.
            data = _renamed(data, growth="", **({} if data.unit else {"unit": ""}))
            data |= {"grows": {**vars(growth), "per": "h"}} if growth else {}
        case _ if is_dataclass(data):
            data = vars(data)
    if isinstance(data, Mapping):
        return {key: _form(value) for key, value in data.items()}
    if isinstance(data, np.ndarray | np.generic):
        data = data.tolist()
    if isinstance(data, list | tuple):
        return [_form(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _renamed(data: Any, **names: str) -> dict[str, Any]:
    """The fields of a dataclass, some renamed; those renamed to "" are dropped."""
    found = {names.get(name, name): value for name, value in vars(data).items()}
    found.pop("", None)
    return found


def _shape(shape: Shape) -> dict[str, Any]:
    """The shape of a term without a name; rows are driver, value and standard uncertainty."""
    same = ("driver", "driver_unit", "unit", "means", "text", "monotone")
    points = np.column_stack([shape.at, shape.value, shape.u])
    return {
        "shape": {name: getattr(shape, name) for name in same} | {"points": points},
        "memory": {"answer": shape.memory, "text": shape.memory_text},
        "beaten": shape.beaten,
    }


def _repair(mismatch: Mismatch, plant_file: str) -> dict[str, Any]:
    """The data from which ``rulec adopt`` rebuilds the repaired model; numbers in SI.

    The id of an unknown is that of its candidate, a dot and its name. `recalibrated` holds the
    plain plant with other values only, which can always be written.
    """
    plain, repair = mismatch.plain, mismatch.repair
    found = {finding.id: finding for finding in mismatch.findings}
    joined = [
        {
            "id": name,
            "effect": found[name].name if name in found else None,
            "module": found[name].module if name in found else None,
            "place": found[name].place if name in found else None,
            "unknowns": {p.id: p.value for p in repair.parameters if p.id.startswith(f"{name}.")},
            "fixed": {k: v for k, v in repair.fixed.items() if k.startswith(f"{name}.")},
        }
        for name in repair.joined
    ]
    return {
        "plant": plant_file,
        "joined": joined,
        "curves": repair.curves,
        **_values(repair),
        "misread": [{"kind": m.kind, **vars(m.mending)} for m in mismatch.misread],
        "rewired": mismatch.rewired,
        "left_out": [{"id": name, "reason": reason} for name, reason in mismatch.left_out],
        "refused": mismatch.refused or None,
        "checks": mismatch.checks,
        "recalibrated": None if plain is None else _values(plain),
    }


def _values(found: Repair) -> dict[str, Any]:
    return {
        "parameters": [p.id for p in found.parameters],
        "values": [p.value for p in found.parameters],
        "covariance": found.covariance,
        "misfit": found.misfit,
        "range": found.ranges,
    }
