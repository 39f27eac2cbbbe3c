"""Pass 4, derive residuals: pairs of flow estimates that must agree."""

from __future__ import annotations

from dataclasses import dataclass

from rulec.link import Network


@dataclass(frozen=True)
class Residual:
    """A signed sum of observers, zero in a healthy plant; terms are (sign, observer id)."""

    id: str
    module: str
    terms: tuple[tuple[int, str], ...]

    def __str__(self) -> str:
        parts = [f"{'+' if sign > 0 else '-'} {name}" for sign, name in self.terms]
        return " ".join(parts).removeprefix("+ ")


@dataclass(frozen=True)
class Residuals:
    """A network with its residuals."""

    network: Network
    residuals: tuple[Residual, ...]


def derive_residuals(network: Network) -> Residuals:
    """Own pairs of each module, then each balance sum against an own observer.

    The sum of the pumps upstream against the resistance of a mixer, for example, becomes
    ``pump-resis`` of the mixer: `A.pump + B.pump - C.resis`.
    """
    found = []
    for module in network.plant.modules.values():
        for first, second in module.type.residuals:
            pair = ((1, f"{module.name}.{first}"), (-1, f"{module.name}.{second}"))
            found.append(Residual(f"{module.name}.{first}-{second}", module.name, pair))
        for (name, kind), sources in network.sums.items():
            if name != module.name:
                continue
            for own in module.type.observers:
                summed = tuple((sign, f"{source}.{kind}") for sign, source in sources)
                terms = (*summed, (-1, f"{name}.{own}"))
                found.append(Residual(f"{name}.{kind}-{own}", name, terms))
    return Residuals(network, tuple(found))
