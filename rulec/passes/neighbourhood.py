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


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A reading that could be added.

    `title` describes it in words; `cost` is relative. It is compared with `existing`, an estimate
    (`is_estimate`) or a reading; `u` is its own standard uncertainty.
    """

    module: str
    signal: str
    title: str
    cost: float
    existing: str
    is_estimate: bool
    u: float


@dataclass(frozen=True)
class Neighbourhood:
    """Residuals around some modules, linearised and whitened.

    Attributes
    ----------
    faults : row in `effects` of each fault.
    effects : shape (faults, residuals), standard deviations per unit of degree.
    whiten : shape (residuals, inputs), gradients of the whitened residuals by the inputs.
    inputs : column in `whiten` of each input.
    plant : the tables from which the numbers come.
    """

    faults: Mapping[str, int]
    effects: Array
    whiten: Array
    inputs: Mapping[str, int]
    plant: Linearised

    @staticmethod
    def of(
        plant: Linearised, residuals: Sequence[Mapping[str, int]], faults: Sequence[str]
    ) -> Neighbourhood:
        """Build it from independent residuals, each as observer -> sign."""
        observers = {o: i for i, o in enumerate(dict.fromkeys(o for r in residuals for o in r))}
        names = dict.fromkeys(n for o in observers for n in plant.gradients[o])
        inputs = {name: i for i, name in enumerate(names)}
        signs = np.zeros((len(residuals), len(observers)))
        for row, residual in zip(signs, residuals, strict=True):
            for observer, sign in residual.items():
                row[observers[observer]] = sign
        gradients = np.zeros((len(observers), len(inputs)))
        for observer, i in observers.items():
            for name, slope in plant.gradients[observer].items():
                gradients[i, inputs[name]] = slope
        effects = np.zeros((len(faults), len(observers)))
        for row, fault in zip(effects, faults, strict=True):
            for observer, effect in plant.effects[fault].items():
                if observer in observers:
                    row[observers[observer]] = effect
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
        slopes = np.zeros((len(sensors), len(self.inputs)))
        effects = np.zeros((len(faults), len(sensors)))
        own = np.empty(len(sensors))
        for k, sensor in enumerate(sensors):
            gradient, by_fault = self._difference(sensor, faults)
            beyond = 0.0
            for name, slope in gradient.items():
                if name in self.inputs:
                    slopes[k, self.inputs[name]] = slope
                else:
                    beyond += slope**2
            own[k] = sensor.u**2 + beyond
            effects[:, k] = by_fault
        size = np.sqrt(own + np.sum(slopes**2, axis=1))
        size[size == 0] = 1.0
        slopes, effects, own = slopes / size[:, None], effects / size, own / size**2
        shared = self.whiten @ slopes.T
        rows = self.effects[[self.faults[f] for f in faults]]
        return effects - rows @ shared, slopes @ slopes.T + np.diag(own) - shared.T @ shared

    def _difference(
        self, sensor: Sensor, faults: Sequence[str]
    ) -> tuple[Mapping[str, float], list[float]]:
        """Existing reading or estimate minus the new one: its gradient, and effects of faults."""
        name, plant = sensor.existing, self.plant
        if sensor.is_estimate:
            return plant.gradients[name], [plant.effects[f].get(name, 0.0) for f in faults]
        shifts = [plant.shifts[f] if plant.targets.get(f) == name else 0.0 for f in faults]
        return {name: plant.uncertainties[name]}, shifts


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
    """Slopes at the reference point, SI.

    Attributes
    ----------
    gradients : per observer d(estimate)/d(input) times the input's standard uncertainty, m3/s.
    flows : per observer its estimate, m3/s.
    uncertainties : standard uncertainty of each reading, in its unit.
    effects : per fault d(estimate)/d(degree, as a share) of the observers it makes wrong, m3/s.
    shifts : per fault of a reading, d(reading)/d(degree, as a share), in the unit of the reading.
    targets : per fault of a reading, the reading.
    """

    gradients: Mapping[str, Mapping[str, float]]
    flows: Mapping[str, float]
    uncertainties: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]]
    shifts: Mapping[str, float]
    targets: Mapping[str, str]


def linearise(network: Network, assembly: Assembly, signatures: Signatures) -> Linearised:
    """Evaluate gradients and slopes at the reference point."""
    graph = assembly.graph
    outputs = {
        f"{observer}|{name}": node
        for observer, gradient in assembly.gradients.items()
        for name, node in gradient.items()
    }
    moved: dict[str, tuple[str, ...]] = {}
    of_signals: dict[str, str] = {}
    for h in assembly.hypotheses:
        onset, scale = h.fault.rule.onset, graph.constant(h.fault.variant.scale)
        if h.fault.fault.acts_on == "flow":
            found = {o: lower(graph, onset, {G: assembly.observers[o]}) for o in h.affects}
        else:
            target = assembly.targets[h.target]
            shift = lower(graph, onset, {G: target.value})
            found = {o: graph.mul(shift, target.slopes[o]) for o in h.affects if o in target.slopes}
            if h.fault.fault.acts_on == "signal":
                of_signals[h.id] = h.target
                outputs[f"{h.id}|shift"] = graph.mul(shift, scale)
        moved[h.id] = tuple(found)
        outputs |= {f"{h.id}|{o}": graph.mul(node, scale) for o, node in found.items()}
    inputs = reference_inputs(network, signatures.reference)
    values = {k: float(v[0]) for k, v in graph.plan(outputs).run(inputs).items()}
    return Linearised(
        gradients={
            observer: {name: values[f"{observer}|{name}"] for name in gradient}
            for observer, gradient in assembly.gradients.items()
        },
        flows=signatures.flows,
        uncertainties={
            k.removeprefix("u:"): v for k, v in inputs.items() if k.startswith("u:") and "." in k
        },
        effects={h: {o: values[f"{h}|{o}"] for o in observers} for h, observers in moved.items()},
        shifts={h: values[f"{h}|shift"] for h in of_signals},
        targets=of_signals,
    )
