"""The results of the passes for one plant, in one flat record."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Cell, Ruleset, Simulation

from rulec.knowledge.plant import Plant
from rulec.knowledge.sources import Sources
from rulec.passes.analyse_isolability import Isolability
from rulec.passes.assemble import Assembly
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_signatures import Signatures
from rulec.passes.differentiate import TypeModel
from rulec.passes.link import Network
from rulec.passes.put_balances import Balanced

_LATER: Any = None
"""The pass has not run."""


@dataclass(frozen=True, kw_only=True)
class Compilation:
    """One field for each pass, in their order; None until it has run. `types` are by key."""

    path: Path = _LATER
    sources: Sources = _LATER
    plant: Plant = _LATER
    network: Network = _LATER
    residuals: tuple[Residual, ...] = _LATER
    types: Mapping[str, TypeModel] = _LATER
    assembly: Assembly = _LATER
    signatures: Signatures = _LATER
    rules: tuple[Cell, ...] = _LATER
    isolability: Isolability = _LATER
    simulation: Simulation = _LATER
    balanced: Balanced = _LATER
    ruleset: Ruleset = _LATER
