"""The plant folder as a plant engineer writes it: instances and connections only."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..units import BAR, LITRE_PER_HOUR
from .rig import Rig


def write_plant(rig: Rig, folder: Path) -> None:
    """Write `plant.yaml`."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["plant: concealed", "title: A plant of the proof", "modules:"]
    lines += [f"  {name}: {{type: {rig.kind(name).type}}}" for name in rig.pumps]
    for name, size in rig.mixers.items():
        if size == 1.0:
            lines.append(f"  {name}: {{type: static-mixer}}")
        else:
            value, u = rig.numbers[f"{name}.k2"]
            unit = BAR / LITRE_PER_HOUR**2
            lines += [
                f"  {name}:",
                "    type: static-mixer",
                "    parameters:",
                f"      k2: {{value: {value / unit:.6g}, unit: bar/(l/h)**2, u: {u / unit:.3g}, "
                'source: "data sheet"}',
            ]
    links = [f"  - {a} -> {b}" for a, b in rig.downstream.items() if b is not None]
    if links:
        lines += ["connections:", *links]
    (folder / "plant.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_limits(rig: Rig, ranges: Mapping[str, tuple[float, float]], file: Path) -> None:
    """Write the limits of the inputs; `ranges` in SI."""
    lines = ["limits: concealed", "inputs:"]
    for name, ends in ranges.items():
        sensor = rig.sensors[name]
        low, high = ((end - sensor.offset) / sensor.scale for end in ends)
        lines.append(f'  {name}: {{lowest: {low:.6g}, highest: {high:.6g}, unit: "{sensor.unit}"}}')
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
