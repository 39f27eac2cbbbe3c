"""An engineer's description of a plant, checked, in SI."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from rulec_runtime.contract.file_form import FileForm
from rulec_runtime.contract.ruleset import ColumnMap

from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.layers import Layer
from rulec.knowledge.module_type import Fluid, ModuleType, Parameter
from rulec.language.diagnostics import Place


@dataclass(frozen=True)
class Block:
    """Covariance of some parameters of one module, SI; `factor` is its Cholesky factor."""

    parameters: tuple[str, ...]
    factor: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Module:
    """An instance of a module type with its values, in SI.

    `stated` are the parameters of the type and the plant, `parameters` those after calibration.
    `misfit` per observer (m3/s) and `valid` per signal come from calibration; `reference` holds
    readings at a typical operating point. `fluid` is None if none is named.
    """

    name: str
    title: str
    type: ModuleType
    stated: Mapping[str, Parameter]
    parameters: Mapping[str, Parameter]
    blocks: tuple[Block, ...]
    misfit: Mapping[str, float]
    valid: Mapping[str, tuple[float, float]]
    reference: Mapping[str, float]
    fluid: Fluid | None = None


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Modules and directed connections, with the knowledge they use.

    `digest` is the hash of everything it is made from; `layers` are the folders of knowledge that
    it uses, each with the hash of what it takes from there.
    """

    name: str
    title: str
    modules: Mapping[str, Module]
    connections: tuple[tuple[str, str], ...]
    columns: tuple[ColumnMap, ...]
    time_column: str
    time_zone: str
    file: FileForm
    knowledge: Knowledge
    digest: str
    place: Place
    layers: tuple[tuple[Layer, str], ...] = ()

    @cached_property
    def _columns_of(self) -> Counter[str]:
        return Counter(column.signal for column in self.columns)

    def spread(self, signal: str) -> float:
        """Uncertainty of a reading, relative to that of one sensor: of two columns that of two."""
        return math.sqrt(max(1, self._columns_of[signal]))

    @property
    def signals(self) -> list[str]:
        """Ids of all signals, such as ``A.dp``."""
        return [f"{m.name}.{s}" for m in self.modules.values() for s in m.type.signals]

    @property
    def observers(self) -> list[str]:
        """Ids of all observers, such as ``A.pump``."""
        return [f"{m.name}.{o}" for m in self.modules.values() for o in m.type.observers]
