"""Pass 10, order equations: which readings a simulation predicts, and in which order it solves.

The unknowns are the flows of modules and the readings that are no inputs and follow from no state.
If there are more unknowns than equations, some readings become given, like inputs. Flows come first
as unknowns; then, in each turn, the reading that moves the disagreement of the estimates most at
the reference point, in a direction that no earlier reading has. So a power on which one estimate
depends strongly is predicted, and a temperature that affects several weakly is given.

Each unknown is matched with an equation of its own. Unknowns that depend on each other form one
step and are solved together; the steps follow one another (block-triangular form).

Source: Dulmage and Mendelsohn 1958; Tarjan 1972.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import networkx as nx
import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Simulation, SimulationStep

from rulec.algebra.eliminate import Span, solved_for
from rulec.algebra.matching import match, surplus
from rulec.knowledge.module_type import Signal
from rulec.passes.assemble import MODEL, PARAMETERS, Assembly
from rulec.passes.derive_signatures import Signatures
from rulec.passes.limits import IMMOVABLE
from rulec.passes.link import Network


def order_equations(network: Network, assembly: Assembly, signatures: Signatures) -> Simulation:
    """Find the predicted readings and order the equations; some plants cannot be simulated.

    >>> from rulec.passes.pipeline import example
    >>> simulation = example("simulation").simulation
    >>> simulation.given, simulation.steps[0].readings
    (('A.n', 'B.n'), ('A.dp', 'B.dp', 'C.dp'))
    """
    system = _System(network, assembly, signatures)
    partner = system.matched(range(len(system.unknowns)))
    if None in partner:
        partner = system.matched(system.by_strength())
    many, unknowns = surplus(system.holders, partner, system.equations)
    if many:
        return Simulation((), (), system.over_determined(many, unknowns))
    predicted = {
        name for name, own in zip(system.unknowns, partner, strict=True) if own is not None
    }
    given = tuple(name for name in system.used if name not in predicted)
    return Simulation(given, tuple(_steps(system, partner)), "")


def _steps(system: _System, partner: Sequence[int | None]) -> Iterator[SimulationStep]:
    """Steps in order: equations that depend on each other, and the unknowns matched to them."""
    graph = nx.DiGraph()
    graph.add_nodes_from(range(system.equations))
    for own, holders in zip(partner, system.holders, strict=True):
        if own is not None:
            graph.add_edges_from((own, i) for i in holders if i != own)
    parts = nx.condensation(graph)
    members = parts.nodes(data="members")
    unknown = {own: name for name, own in zip(system.unknowns, partner, strict=True)}
    for part in nx.lexicographical_topological_sort(parts, key=lambda p: min(members[p])):
        yield system.step(sorted(members[part]), [unknown[i] for i in sorted(members[part])])


class _System:
    """Equations (observers, then balances) and unknowns (flows, then readings) by number."""

    def __init__(self, network: Network, assembly: Assembly, signatures: Signatures) -> None:
        self.network, self.assembly, self.signatures = network, assembly, signatures
        modules = network.plant.modules
        self.observers = tuple(assembly.observers)
        self.module_of = [observer.partition(".")[0] for observer in self.observers]
        self.flows = tuple(m for m in modules if m in self.module_of)
        # Junctions that modules without an observer join are one place; what circulates without
        # leaving the plant balances by itself at the last place.
        span, number = Span(), {name: i for i, name in enumerate(self.flows)}
        self.balances = [
            signs
            for signs in network.graph.measured_balances(self.flows).values()
            if span.add({number[name]: sign for name, sign in signs.items()})
        ]
        self.equations = len(self.observers) + len(self.balances)
        reads = {name for gradient in assembly.gradients.values() for name in gradient}
        signals = {
            f"{m.name}.{s.name}": s for m in modules.values() for s in m.type.signals.values()
        }
        self.used: Mapping[str, Signal] = {k: s for k, s in signals.items() if k in reads}
        stored = {f"{m.name}.{name}" for m in modules.values() for name in m.type.readings}
        # Readings that follow from states are given in equations without time.
        self.readings = tuple(
            name for name, s in self.used.items() if not s.is_input and name not in stored
        )
        self.unknowns = (*self.flows, *self.readings)
        self.number = {name: i for i, name in enumerate(self.unknowns)}

    @cached_property
    def holders(self) -> list[list[int]]:
        """Per unknown the numbers of the equations that contain it."""
        found: dict[str, list[int]] = {name: [] for name in self.unknowns}
        for i, (observer, module) in enumerate(zip(self.observers, self.module_of, strict=True)):
            found[module].append(i)
            for name in self.assembly.gradients[observer]:
                if name in self.number:
                    found[name].append(i)
        for i, terms in enumerate(self.balances, len(self.observers)):
            for flow in terms:
                found[flow].append(i)
        return list(found.values())

    def matched(self, order: Sequence[int]) -> list[int | None]:
        """Equation of each unknown; unknowns are matched in the given order."""
        partner: list[int | None] = [None] * len(self.unknowns)
        for unknown, own in zip(order, match([self.holders[i] for i in order]), strict=True):
            partner[unknown] = own
        return partner

    def step(self, equations: Sequence[int], unknowns: Sequence[str]) -> SimulationStep:
        """A step with its flows eliminated, as these are linear in all equations."""
        numbers = sorted(self.number[name] for name in unknowns)
        flows = [self.unknowns[i] for i in numbers if i < len(self.flows)]
        readings = [self.unknowns[i] for i in numbers if i >= len(self.flows)]
        sums = [self._sum(i) for i in equations]
        named = dict.fromkeys(flows)
        others = list(dict.fromkeys(name for part in sums for name in part if name not in named))
        matrix = np.array(
            [[part.get(name, 0.0) for name in [*flows, *others]] for part in sums], dtype=float
        )
        solved, left = solved_for(matrix, len(flows))
        return SimulationStep(
            tuple(readings),
            tuple(_terms(others, row) for row in left),
            {name: _terms(others, row) for name, row in zip(flows, solved, strict=True)},
        )

    def _sum(self, equation: int) -> Mapping[str, float]:
        """An equation as a sum of estimates and flows that equals zero."""
        if equation < len(self.observers):
            return {self.module_of[equation]: -1.0, self.observers[equation]: 1.0}
        return self.balances[equation - len(self.observers)]

    def by_strength(self) -> list[int]:
        """Numbers of the unknowns: flows, then readings, by descending effect on the estimates.

        Source: orthogonalisation with column pivoting (Businger and Golub 1965).
        """
        count, slopes = len(self.flows), self._slopes()
        basis, _ = np.linalg.qr(slopes[:, :count])
        rest = slopes[:, count:] - basis @ (basis.T @ slopes[:, count:])
        order: list[int] = []
        for _ in self.readings:
            # Rounded, so that of two equal effects the first is taken on every machine.
            sizes = np.round(np.linalg.norm(rest, axis=0), 9)
            sizes[order] = -1.0
            order.append(int(np.argmax(sizes)))
            if sizes[order[-1]] > IMMOVABLE:
                pivot = rest[:, order[-1]] / np.linalg.norm(rest[:, order[-1]])
                rest = rest - np.outer(pivot, pivot @ rest)
        return [*range(count), *(count + i for i in order)]

    def _slopes(self) -> Array:
        """Scaled derivatives of the equations by the unknowns at the reference point."""
        gradients, reference = self.assembly.gradients, self.signatures.reference
        nodes = {
            f"{i}|{name}": gradients[o][name]
            for i, o in enumerate(self.observers)
            for name in self.readings
            if name in gradients[o]
        }
        # Gradients are scaled by uncertainties; with units instead, they are plain derivatives.
        units = {f"u:{name}": 1.0 for name in reference}
        plan = self.assembly.graph.plan(nodes)
        values = plan.run({**reference, **units, PARAMETERS: 1.0, MODEL: 1.0})
        sizes = self._flow_sizes()
        result = np.zeros((self.equations, len(self.unknowns)))
        for i, module in enumerate(self.module_of):
            result[i, self.number[module]] = -1.0
        for i, signs in enumerate(self.balances, len(self.observers)):
            for name, sign in signs.items():
                result[i, self.number[name]] = sign * sizes[self.number[name]] / sizes.max()
        for key, value in values.items():
            observer, _, name = key.partition("|")
            signal, row = self.used[name], int(observer)
            shown = abs(reference[name] - signal.unit.offset) or signal.full_scale or 1.0
            flow = sizes[self.number[self.module_of[row]]]
            result[row, self.number[name]] = value[0] * shown / flow
        return np.nan_to_num(result)

    def _flow_sizes(self) -> Array:
        """Flows at the reference point, m3/s."""
        own = zip(self.module_of, self.observers, strict=True)
        sizes = {module: abs(self.signatures.flows[o]) for module, o in own}
        flows = np.array([sizes[m] for m in self.flows])
        return np.where(flows > 0, flows, np.max(flows, initial=0.0) or 1.0)

    def over_determined(self, many: Sequence[int], unknowns: Sequence[int]) -> str:
        observers = [self.observers[i] for i in many if i < len(self.observers)]
        readings = [self.unknowns[i] for i in unknowns if i >= len(self.flows)]
        free = f"only {', '.join(readings)} and the flows" if readings else "only the flows"
        return (
            f"{self.network.plant.name} cannot be simulated: {', '.join(observers)} and the "
            f"junctions between them are more equations than unknowns ({free} can follow). Each "
            "observer too many needs a reading of its own that is not 'input: true'"
        )


def _terms(names: Sequence[str], row: Array) -> dict[str, float]:
    return {names[i]: float(row[i]) for i in np.flatnonzero(row).tolist()}
