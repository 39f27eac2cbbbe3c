"""Ways in which modules may be connected otherwise than the plant file says, one pipe at a time.

Whatever has an open end may feed; fed are modules of a type of which one is fed in this plant, as
pumps that draw from vessels are not. What the compiler refuses, or what is the same network, is no
other way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rulec.algebra.continuity import Balance
from rulec.knowledge.plant import Plant
from rulec.passes.link import junctions

Pipe = tuple[str, str]
"""What feeds, and what is fed."""


@dataclass(frozen=True)
class Rewiring:
    """A pipe as `stated` in the plant file (None: it has none), and as it `fits` the readings."""

    stated: Pipe | None
    fits: Pipe | None

    def of(self, connections: Sequence[Pipe]) -> tuple[Pipe, ...]:
        """Connections with the pipe as it fits, in its place."""
        if self.stated is None:
            assert self.fits is not None
            return (*connections, self.fits)
        own = () if self.fits is None else (self.fits,)
        at = list(connections).index(self.stated)
        return (*connections[:at], *own, *connections[at + 1 :])

    @property
    def modules(self) -> tuple[str, ...]:
        """Modules at either end, each once."""
        ends = (*(self.stated or ()), *(self.fits or ()))
        return tuple(dict.fromkeys(ends))

    @property
    def sources(self) -> tuple[str, ...]:
        """Modules whose outlet leads elsewhere than stated."""
        own = [pipe[0] for pipe in (self.stated, self.fits) if pipe is not None]
        return tuple(dict.fromkeys(own))


def rewirings(plant: Plant, off: Mapping[str, float], most: int) -> tuple[Rewiring, ...]:
    """Other networks that differ by one pipe, at most so many.

    `off` is by how much each module contradicts others: a pipe that begins and ends at modules that
    contradict nothing is right. Those whose ends contradict most come first.
    """
    seen = {_network(plant, plant.connections)}
    found = []
    for rewiring in _every(plant):
        network = _network(plant, rewiring.of(plant.connections))
        if network not in seen and any(off.get(m, 0.0) > 0.0 for m in rewiring.modules):
            seen.add(network)
            found.append(rewiring)
    found.sort(key=lambda r: -max(off.get(m, 0.0) for m in r.modules))
    return tuple(found[:most])


def _network(plant: Plant, connections: tuple[Pipe, ...]) -> tuple[Balance, ...]:
    return junctions(replace(plant, connections=connections))


def _every(plant: Plant) -> Iterator[Rewiring]:
    """Each pipe moved at one end, turned about or taken away; then each that is not there."""
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
    for source in sources:
        for target in targets:
            if is_new((source, target)):
                yield Rewiring(None, (source, target))
