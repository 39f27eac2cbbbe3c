"""Random plants: pumps of several kinds feed mixers, or oil sets work against a load."""

from __future__ import annotations

import numpy as np

from .rig import Rig

FIRST = "ABDEFGHK"
KINDS = ("cavity", "cavity", "cavity", "membrane", "centrifugal")


def dosing_rig(random: np.random.Generator, small: bool = False) -> Rig:
    """Draw two to five pumps that feed one to three mixers, in series or parallel.

    A small plant has two pumps and one mixer. The size of a mixer follows from its flow.
    """
    count = 2 if small else int(random.choice([2, 2, 2, 3, 3, 4, 5]))
    names = list(FIRST[:count])
    pumps = {name: str(random.choice(KINDS)) for name in names}
    shapes = ["one"] if count == 2 else ["one", "series", "series"]
    shape = str(random.choice(shapes if count < 4 else [*shapes, "parallel"]))
    downstream: dict[str, str | None]
    if shape == "one":
        downstream = {**dict.fromkeys(names, "M"), "M": None}
    elif shape == "series":
        cut = int(random.integers(1, count)) if count > 2 else 1
        cut = max(cut, 2) if count > 2 else cut
        downstream = {n: "M1" if i < cut else "M2" for i, n in enumerate(names)}
        downstream |= {"M1": "M2", "M2": None}
    else:
        half = count // 2
        downstream = {n: "M1" if i < half else "M2" for i, n in enumerate(names)}
        downstream |= {"M1": "M3", "M2": "M3", "M3": None}
    mixers = [m for m in ("M", "M1", "M2", "M3") if m in downstream]
    weak = "centrifugal" in pumps.values()
    sizes: dict[str, float] = {m: _size(m, names, downstream, weak, len(mixers)) for m in mixers}
    letters = "".join(k[0] for k in pumps.values())
    return Rig(f"{shape}-{letters}", pumps, sizes, downstream)


def oil_rig(random: np.random.Generator, small: bool = False) -> Rig:
    """Draw one or two oil sets, each with its own load; small: one."""
    names = ["main", "aux"][: 1 if small else int(random.choice([1, 1, 2]))]
    return Rig(f"oil-{len(names)}", dict.fromkeys(names, "oil-set"), {}, dict.fromkeys(names, None))


def warm_rig(random: np.random.Generator, small: bool = False) -> Rig:
    """Return an oil set whose laws depend on the temperature of the oil."""
    return Rig("warm", {"A": "oil-warm"}, {}, {"A": None})


def bench_rig(random: np.random.Generator, small: bool = False) -> Rig:
    """Draw one or two metered centrifugal pumps, each between two valves; small: one."""
    names = ["A", "B"][: 1 if small else int(random.choice([1, 1, 2]))]
    return Rig(f"bench-{len(names)}", dict.fromkeys(names, "metered"), {}, dict.fromkeys(names))


def valve_rig(random: np.random.Generator, small: bool = False) -> Rig:
    """Draw one or two control valves, each between its own pressures; small: one."""
    names = ["A", "B"][: 1 if small else int(random.choice([1, 1, 2]))]
    return Rig(f"valve-{len(names)}", dict.fromkeys(names, "valve"), {}, dict.fromkeys(names))


def _size(
    mixer: str, names: list[str], downstream: dict[str, str | None], weak: bool, mixers: int
) -> float:
    """Friction as multiple of that of a DN15 mixer, which suits two pumps."""
    feeding = 0
    for name in names:
        at: str | None = name
        while at is not None and at != mixer:
            at = downstream[at]
        feeding += at == mixer
    loss = (0.3 if weak else 1.0) / mixers
    return round(loss * (2.0 / feeding) ** 2, 3)
