"""Other connections of modules than in the plant file, one pipe at a time.

Any module may feed. Only modules of a type that is fed somewhere in this plant may be fed, unlike
pumps that draw from vessels. Networks that the compiler refuses, and equal networks, do not count.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from rulec.algebra.continuity import Balance
from rulec.knowledge.plant import Plant
from rulec.passes.link import junctions

Pipe = tuple[str, str]
"""The source and the target of a connection."""


@dataclass(frozen=True)
class Rewiring:
    """A pipe as `stated` in the plant file (None: not there), and as it `fits` the readings."""

    stated: Pipe | None
    fits: Pipe | None

    def of(self, connections: Sequence[Pipe]) -> tuple[Pipe, ...]:
        """Connections with the pipe replaced as it fits."""
        if self.stated is None:
            assert self.fits is not None
            return (*connections, self.fits)
        own = () if self.fits is None else (self.fits,)
        at = list(connections).index(self.stated)
        return (*connections[:at], *own, *connections[at + 1 :])

    @property
    def modules(self) -> tuple[str, ...]:
        """Modules at either end, each once."""
        return tuple(dict.fromkeys((*(self.stated or ()), *(self.fits or ()))))

    @property
    def sources(self) -> tuple[str, ...]:
        """Modules whose outlet leads elsewhere than stated."""
        own = [pipe[0] for pipe in (self.stated, self.fits) if pipe is not None]
        return tuple(dict.fromkeys(own))


def rewirings(plant: Plant, off: Mapping[str, float], most: int) -> tuple[Rewiring, ...]:
    """At most `most` other networks that differ by one pipe.

    `off` is how much each module contradicts others. A pipe between modules without contradiction
    is right. Pipes at modules with the largest contradiction come first.
    """
    known = {_network(plant, plant.connections)}
    found = []
    for rewiring in _every(plant):
        network = _network(plant, rewiring.of(plant.connections))
        if network not in known and any(off.get(m, 0.0) > 0.0 for m in rewiring.modules):
            known.add(network)
            found.append(rewiring)
    found.sort(key=lambda r: -max(off.get(m, 0.0) for m in r.modules))
    return tuple(found[:most])


def _network(plant: Plant, connections: tuple[Pipe, ...]) -> tuple[Balance, ...]:
    return junctions(replace(plant, connections=connections))


def _every(plant: Plant) -> Iterator[Rewiring]:
    """Each pipe moved at one end, reversed or removed; then each missing one added."""
    stated = plant.connections
    kind = {name: module.type.name for name, module in plant.modules.items()}
    fed = {kind[target] for _, target in stated}
    sources = list(plant.modules)
    targets = [name for name in plant.modules if kind[name] in fed]

    def is_new(pipe: Pipe) -> bool:
        return pipe[1] in targets and pipe[0] != pipe[1] and pipe not in stated

    for source, target in stated:
        ends = [(source, other) for other in targets] + [(other, target) for other in sources]
        for pipe in filter(is_new, (*ends, (target, source))):
            yield Rewiring((source, target), pipe)
        yield Rewiring((source, target), None)
    for pipe in filter(is_new, product(sources, targets)):
        yield Rewiring(None, pipe)
