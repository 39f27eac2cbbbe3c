"""A builder whose estimates are all in another unit: nothing that is told may depend on it."""

from __future__ import annotations

from dataclasses import replace

from rulec_runtime.contract.plan import Plan

from rulec.effects.candidate import BaseParameters, Candidate, DisturbanceLocation, Missing
from rulec.effects.model_builder import ModelBuilder


class Rescaled:
    """Estimates of a builder times a number."""

    def __init__(self, builder: ModelBuilder, factor: float) -> None:
        self._builder, self._factor = builder, factor

    @property
    def parameters(self) -> BaseParameters:
        return self._builder.parameters

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        return self._builder.candidates

    @property
    def missing(self) -> tuple[Missing, ...]:
        return self._builder.missing

    @property
    def spots(self) -> tuple[DisturbanceLocation, ...]:
        return self._builder.spots

    def plan(self, module: str, joined: tuple[str, ...], spots: tuple[str, ...] = ()) -> Plan:
        """The plan with one more operation behind each estimate."""
        plan = self._builder.plan(module, joined, spots)
        place = len(plan.inputs) + len(plan.constants)
        moved = {i: i if i < place else i + 1 for i in range(place + len(plan.operations))}
        operations = [(name, moved[a], moved.get(b, 0)) for name, a, b in plan.operations]
        outputs = {name: moved[i] for name, i in plan.outputs.items()}
        for name in [n for n in outputs if n.startswith("q:")]:
            operations.append(("mul", outputs[name], place))
            outputs[name] = place + len(operations)
        constants = (*plan.constants, self._factor)
        return replace(plan, constants=constants, operations=tuple(operations), outputs=outputs)

    def free_form(self, spot: str, features: tuple[str, ...]) -> Candidate:
        return self._builder.free_form(spot, features)

    def equation(self, module: str, joined: tuple[str, ...], place: str) -> str:
        return self._builder.equation(module, joined, place)
