"""Pass 7, derive signatures: the fault-symptom matrix at the reference point.

Nothing is written by hand: the derivative of a fault's law at degree 0, times the slope of each
residual by the fault's target, gives size and sign of every cell.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Cell
from rulec_runtime.contract.threshold import threshold_of

from rulec.algebra.graph import Node
from rulec.algebra.recipe import lower
from rulec.language.write_yaml import rounded
from rulec.limits import MOST_RULES
from rulec.passes.assemble import MODEL, PARAMETERS, Assembly, Hypothesis
from rulec.passes.derive_residuals import Residual
from rulec.passes.differentiate import G
from rulec.passes.limits import DIGITS, NEGLIGIBLE_EFFECT
from rulec.passes.link import Network
from rulec.passes.reference import solve_reference


@dataclass(frozen=True, kw_only=True)
class Signature:
    """One non-zero cell of the matrix.

    `gain` is dR/dg, with g the target that the fault scales, `sensitivity` dR/dx (m3/s), and
    `detectable` the degree at which the residual reaches its threshold. `scaled` and `slope` are
    the nodes of g and dR/dg; `faulty` are the observers of the residual that the fault makes wrong,
    with signs.
    """

    fault: str
    residual: str
    sign: int
    gain: float
    sensitivity: float
    detectable: float
    scaled: Node
    slope: Node
    faulty: tuple[tuple[int, str], ...]

    def cell(self, forms: tuple[str, ...] = (), equation: str = "") -> Cell:
        """The cell of the ruleset, with the forms of its rule, if it has one."""
        return Cell(
            self.fault,
            self.residual,
            self.sign,
            rounded(self.gain, DIGITS),
            rounded(self.sensitivity, DIGITS),
            rounded(self.detectable, DIGITS),
            forms,
            equation,
        )


@dataclass(frozen=True)
class Signatures:
    """The reference point, flows and uncertainties there, and the matrix.

    `unlisted` are the cells of errors that no module lists, for each the most sensitive ones.
    """

    reference: Mapping[str, float]
    flows: Mapping[str, float]
    uncertainties: Mapping[str, float]
    cells: tuple[Signature, ...]
    unlisted: tuple[Signature, ...] = ()


def derive_signatures(
    network: Network, residuals: tuple[Residual, ...], assembly: Assembly
) -> Signatures:
    """Find every cell of the fault-symptom matrix that is not zero.

    >>> from rulec.passes.pipeline import example
    >>> cell = example("signatures").signatures.cells[0]
    >>> cell.fault, cell.residual, cell.sign, round(cell.detectable, 3)
    ('A.leakage', 'A.pump-plant', 1, 0.017)
    """
    reference = solve_reference(network, residuals, assembly)
    holding = _residuals_by_observer(residuals)
    candidates = [
        (h, residual, *found)
        for h in (*assembly.hypotheses, *assembly.unlisted)
        for residual, found in _reached(residuals, assembly, h, holding).items()
    ]
    graph = assembly.graph
    outputs = {}
    for i, (h, _, _, scaled, slope) in enumerate(candidates):
        outputs[f"slope:{i}"] = slope
        onset = lower(graph, h.fault.rule.onset, {G: scaled})
        outputs[f"effect:{i}"] = graph.mul(slope, onset)
    for residual, variance in assembly.residual_variances.items():
        outputs[f"u:{residual}"] = graph.apply("sqrt", variance)
    for observer, node in assembly.observers.items():
        outputs[f"q:{observer}"] = node
    found = graph.plan(outputs).run(reference_inputs(network, reference))
    values = {k: float(v[0]) for k, v in found.items()}
    flows = {o: values[f"q:{o}"] for o in assembly.observers}
    uncertainties = {r: values[f"u:{r}"] for r in assembly.residual_variances}
    cells = []
    for i, (h, residual, faulty, scaled, slope) in enumerate(candidates):
        effect = values[f"effect:{i}"]
        size = max(abs(flows[o]) for _, o in faulty)
        if abs(effect) > NEGLIGIBLE_EFFECT * size:
            u = uncertainties[residual]
            cells.append(
                Signature(
                    fault=h.id,
                    residual=residual,
                    sign=1 if effect > 0 else -1,
                    gain=values[f"slope:{i}"],
                    sensitivity=effect,
                    detectable=threshold_of(u) / abs(effect),
                    scaled=scaled,
                    slope=slope,
                    faulty=faulty,
                )
            )
    names = {h.id for h in assembly.hypotheses}
    listed = tuple(c for c in cells if c.fault in names)
    unlisted = tuple(most_telling([c for c in cells if c.fault not in names]))
    return Signatures(reference, flows, uncertainties, listed, unlisted)


def most_telling(cells: Sequence[Signature]) -> Iterator[Signature]:
    """Cells that get a rule, in their order: for each fault those that detect the least degree.

    A reading that a whole chain uses moves residuals all along it, most of them by far less than
    their noise. Rules for all of them would grow with the square of the plant.
    """
    of_fault: dict[str, list[int]] = {}
    for i, cell in enumerate(cells):
        of_fault.setdefault(cell.fault, []).append(i)
    chosen = {
        i
        for found in of_fault.values()
        for i in sorted(found, key=lambda i: cells[i].detectable)[:MOST_RULES]
    }
    return (cell for i, cell in enumerate(cells) if i in chosen)


def _reached(
    residuals: tuple[Residual, ...],
    assembly: Assembly,
    hypothesis: Hypothesis,
    holding: Mapping[str, list[int]],
) -> dict[str, tuple[tuple[tuple[int, str], ...], Node, Node]]:
    """Residuals that a fault can move: faulty terms, node of g, node of dR/dg."""
    graph, affected = assembly.graph, set(hypothesis.affects)
    result = {}
    for i in sorted({i for o in affected for i in holding.get(o, ())}):
        residual = residuals[i]
        faulty = tuple((s, o) for s, o in residual.terms if o in affected)
        if hypothesis.fault.fault.acts_on == "flow":
            scaled = graph.signed_sum((s, assembly.observers[o]) for s, o in faulty)
            slope = graph.one
        else:
            target = assembly.targets[hypothesis.target]
            scaled = target.value
            slope = graph.signed_sum((s, target.slopes[o]) for s, o in faulty)
        if not graph.is_zero(slope):
            result[residual.id] = (faulty, scaled, slope)
    return result


def _residuals_by_observer(residuals: tuple[Residual, ...]) -> dict[str, list[int]]:
    table: dict[str, list[int]] = {}
    for i, residual in enumerate(residuals):
        for _, observer in residual.terms:
            table.setdefault(observer, []).append(i)
    return table


def reference_inputs(network: Network, reference: Mapping[str, float]) -> dict[str, float]:
    """Reference readings with the systematic uncertainty of their sensors."""
    inputs = {**reference, PARAMETERS: 1.0, MODEL: 1.0}
    plant = network.plant
    for module in plant.modules.values():
        for signal in module.type.signals.values():
            sensor = plant.knowledge.sensors[signal.sensor]
            key = f"{module.name}.{signal.name}"
            one = sensor.uncertainty(signal.full_scale, reference[key])
            inputs[f"u:{key}"] = one * plant.spread(key)
    return inputs
