"""Distances between faults, judged by the estimates of modules that meet.

A fault of degree x moves the residuals by x times its effects. Another fault of any degree cannot
imitate the part of that vector that is orthogonal to its own, in the metric of the residuals'
covariance. Only the modules at the junctions around a group are considered: the whole plant can
only separate faults better, and the effort stays proportional to the number of modules.

Source: own derivation, see docs/method.md; projection in a covariance metric as in any textbook.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.algebra.recipe import lower
from rulec.passes.assemble import Assembly
from rulec.passes.derive_signatures import Signatures, reference_inputs
from rulec.passes.differentiate import G
from rulec.passes.limits import LEAST_SPREAD, ROUNDED_AWAY
from rulec.passes.link import Network

READING = "reading:"
"""Prefix of a reading among the estimates with which a further sensor can be compared."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A reading that could be added.

    `title` describes it in words; `cost` is relative. It is compared with `existing`, an estimate
    or a reading (see `READING`); `u` is its own standard uncertainty.
    """

    module: str
    signal: str
    title: str
    cost: float
    existing: str
    u: float


@dataclass(frozen=True)
class Neighbourhood:
    """Residuals around some modules, linearised and whitened.

    Attributes
    ----------
    faults : row in `effects` of each fault.
    effects : shape (faults, residuals), standard deviations per unit of degree.
    whiten : shape (residuals, inputs), gradients of the whitened residuals by the inputs.
    inputs : the inputs, in the order of these columns.
    plant : the tables from which the numbers come.
    """

    faults: Mapping[str, int]
    effects: Array
    whiten: Array
    inputs: tuple[str, ...]
    plant: Linearised

    @staticmethod
    def of(
        plant: Linearised, residuals: Sequence[Mapping[str, int]], faults: Sequence[str]
    ) -> Neighbourhood:
        """Build it from independent residuals, each as observer -> sign."""
        observers = tuple(dict.fromkeys(o for r in residuals for o in r))
        inputs = tuple(dict.fromkeys(n for o in observers for n in plant.gradients[o]))
        signs = _table(residuals, observers)
        gradients = _table([plant.gradients[o] for o in observers], inputs)
        effects = _table([plant.effects[f] for f in faults], observers)
        # Residuals of an estimate without a finite slope, as of a root at zero, are left out.
        sound = np.isfinite(gradients).all(axis=1) & np.isfinite(effects).all(axis=0)
        gradients[~sound], effects[:, ~sound] = 0.0, 0.0
        signs = signs[~signs[:, ~sound].any(axis=1)]
        spread = signs @ gradients
        size = np.sqrt(np.sum(spread**2, axis=1))
        size = np.maximum(size, LEAST_SPREAD * size.max(initial=1e-300))
        spread /= size[:, None]
        # Inverting the small factor is faster than scipy's triangular solver, and accurate enough:
        # rows have unit size, and the residuals are independent.
        covariance = spread @ spread.T + LEAST_SPREAD * np.eye(len(size))
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        return Neighbourhood(
            {fault: i for i, fault in enumerate(faults)},
            effects @ (signs.T / size) @ whiten.T,
            whiten @ spread,
            inputs,
            plant,
        )

    def gram(self, faults: Sequence[str]) -> Array:
        """Products of effects, shape (faults, faults)."""
        rows = self.effects[[self.faults[f] for f in faults]]
        product: Array = rows @ rows.T
        return product

    def added(self, faults: Sequence[str], sensors: Sequence[Sensor]) -> tuple[Array, Array]:
        """Information of further sensors beyond these residuals.

        Returns effects, shape (faults, sensors), and the covariance of their readings, shape
        (sensors, sensors), both given the residuals, and in units of each sensor's own spread.
        """
        # Each is the difference of an existing reading or estimate and the new one.
        differences = [self.plant.gradients[s.existing] for s in sensors]
        slopes = _table(differences, self.inputs)
        effects = _table([self.plant.effects[f] for f in faults], [s.existing for s in sensors])
        inputs = set(self.inputs)
        beyond = [sum(v**2 for n, v in d.items() if n not in inputs) for d in differences]
        own = np.array([s.u**2 for s in sensors]) + beyond
        size = np.sqrt(own + np.sum(slopes**2, axis=1))
        size[size == 0] = 1.0
        slopes, effects, own = slopes / size[:, None], effects / size, own / size**2
        shared = self.whiten @ slopes.T
        rows = self.effects[[self.faults[f] for f in faults]]
        return effects - rows @ shared, slopes @ slopes.T + np.diag(own) - shared.T @ shared


def _table(rows: Sequence[Mapping[str, float]], columns: Sequence[str]) -> Array:
    """Numbers by name as a matrix, shape (rows, columns); names without a column are left out."""
    index = {name: i for i, name in enumerate(columns)}
    result = np.zeros((len(rows), len(columns)))
    for row, numbers in zip(result, rows, strict=True):
        for name in numbers.keys() & index.keys():
            row[index[name]] = numbers[name]
    return result


def apart(gram: Array) -> Array:
    """Distance of each fault from each other one, in standard deviations per unit of degree.

    Row f, column g: f is the true fault, and g the hypothesis at its best degree (not below 0). The
    diagonal holds distances from the fault-free plant. `gram` has shape (..., faults, faults).
    """
    own = np.diagonal(gram, axis1=-2, axis2=-1)
    along = np.maximum(gram, 0.0) ** 2 / np.where(own > 0, own, 1.0)[..., None, :]
    left = own[..., :, None] - along
    left.reshape(*own.shape[:-1], -1)[..., :: own.shape[-1] + 1] = own
    # Rounding must not separate faults that move all residuals in the same proportion.
    left = np.where(left > ROUNDED_AWAY * own[..., :, None], left, 0.0)
    distance: Array = np.sqrt(left)
    return distance


# The plant linearised at its reference point: slopes of estimates by errors and faults. From these
# tables any set of estimates can be judged, including those with additional sensors.


@dataclass(frozen=True, kw_only=True)
class Linearised:
    """Slopes at the reference point, SI, of estimates and (as `READING`) of readings.

    Attributes
    ----------
    gradients : per estimate d(estimate)/d(input) times the input's standard uncertainty, m3/s; per
        reading its own standard uncertainty.
    effects : per fault d(estimate)/d(degree, as a share) of the estimates it makes wrong, m3/s, and
        d(reading)/d(degree, as a share) of the reading that it changes, if it is one of a reading.
    flows : per observer its estimate, m3/s.
    """

    gradients: Mapping[str, Mapping[str, float]]
    effects: Mapping[str, Mapping[str, float]]
    flows: Mapping[str, float]


def linearise(network: Network, assembly: Assembly, signatures: Signatures) -> Linearised:
    """Evaluate gradients and slopes at the reference point."""
    graph = assembly.graph
    outputs = {("q", o, n): node for o, g in assembly.gradients.items() for n, node in g.items()}
    for h in assembly.hypotheses:
        onset, scale = h.fault.rule.onset, graph.constant(h.fault.variant.scale)
        if h.fault.fault.acts_on == "flow":
            found = {o: lower(graph, onset, {G: assembly.observers[o]}) for o in h.affects}
        else:
            target = assembly.targets[h.target]
            shift = lower(graph, onset, {G: target.value})
            found = {o: graph.mul(shift, target.slopes[o]) for o in h.affects if o in target.slopes}
            if h.fault.fault.acts_on == "signal":
                found[f"{READING}{h.target}"] = shift
        outputs |= {("x", h.id, o): graph.mul(node, scale) for o, node in found.items()}
    inputs = reference_inputs(network, signatures.reference)
    values = graph.plan({"|".join(key): node for key, node in outputs.items()}).run(inputs)
    gradients: dict[str, dict[str, float]] = {o: {} for o in assembly.gradients}
    effects: dict[str, dict[str, float]] = {h.id: {} for h in assembly.hypotheses}
    for key, row, column in outputs:
        table = gradients if key == "q" else effects
        table[row][column] = float(values[f"{key}|{row}|{column}"][0])
    gradients |= {f"{READING}{n}": {n: inputs[f"u:{n}"]} for n in signatures.reference}
    return Linearised(gradients=gradients, effects=effects, flows=signatures.flows)
