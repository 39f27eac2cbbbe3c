"""Random plants, and their files as a plant engineer writes them."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..units import BAR, LITRE_PER_HOUR
from .rig import Rig

FIRST = "ABDEFGHK"
KINDS = ("cavity", "cavity", "cavity", "membrane", "centrifugal")

ALONE: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "oil": ("oil-set", ("main", "aux")),
    "bench": ("metered", ("A", "B")),
    "valve": ("valve", ("A", "B")),
}
"""Kind and names of one or two pumps or valves, each between its own pressures, by family."""


def drawn_rig(family: str, random: np.random.Generator, small: bool = False) -> Rig:
    """Draw a plant of a family: `dosing`, `warm`, or one of ALONE; a small one has fewer pumps."""
    if family == "dosing":
        return _dosing(random, small)
    if family == "warm":
        return Rig("warm", {"A": "oil-warm"}, {}, {"A": None})
    kind, names = ALONE[family]
    names = names[: 1 if small else int(random.choice([1, 1, 2]))]
    return Rig(f"{family}-{len(names)}", dict.fromkeys(names, kind), {}, dict.fromkeys(names))


def _dosing(random: np.random.Generator, small: bool) -> Rig:
    """Two to five pumps that feed one to three mixers, in series or parallel.

    A small plant has two pumps and one mixer. The size of a mixer follows from its flow.
    """
    count = 2 if small else int(random.choice([2, 2, 2, 3, 3, 4, 5]))
    names = list(FIRST[:count])
    pumps = {name: str(random.choice(KINDS)) for name in names}
    shapes = ["one"] if count == 2 else ["one", "series", "series"]
    shape = str(random.choice(shapes if count < 4 else [*shapes, "parallel"]))
    behind: dict[str, str | None]
    if shape == "one":
        cut, behind = count, {"M": None}
    elif shape == "series":
        cut, behind = max(int(random.integers(1, count)), 2), {"M1": "M2", "M2": None}
    else:
        cut, behind = count // 2, {"M1": "M3", "M2": "M3", "M3": None}
    mixers = list(behind)
    downstream = {n: mixers[0 if i < cut else 1] for i, n in enumerate(names)} | behind
    rig = Rig(f"{shape}-{''.join(k[0] for k in pumps.values())}", pumps, {}, downstream)
    # Friction as multiple of that of a DN15 mixer, which suits two pumps.
    loss = (0.3 if "centrifugal" in pumps.values() else 1.0) / len(mixers)
    feeding = {m: sum(m in rig.path(n) for n in names) for m in mixers}
    return replace(rig, mixers={m: round(loss * (2.0 / n) ** 2, 3) for m, n in feeding.items()})


def write_plant(rig: Rig, folder: Path) -> None:
    """Write `plant.yaml`: instances and connections only."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["plant: concealed", "title: A plant of the proof", "modules:"]
    lines += [f"  {name}: {{type: {rig.kind(name).type}}}" for name in rig.pumps]
    for name, size in rig.mixers.items():
        if size == 1.0:
            lines.append(f"  {name}: {{type: static-mixer}}")
        else:
            value, u = (number / (BAR / LITRE_PER_HOUR**2) for number in rig.numbers[f"{name}.k2"])
            stated = f'value: {value:.6g}, unit: bar/(l/h)**2, u: {u:.3g}, source: "data sheet"'
            lines += [f"  {name}:", "    type: static-mixer", "    parameters:"]
            lines.append(f"      k2: {{{stated}}}")
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
