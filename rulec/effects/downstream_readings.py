"""Readings of other modules, as a module type may have them: sums over modules downstream."""

from __future__ import annotations

import ast
from dataclasses import replace

from rulec.knowledge.module_type import ModuleType
from rulec.knowledge.plant import Module
from rulec.language.expression import GATHER
from rulec.language.rewrite import name_node
from rulec.passes.amend import Amended, fresh, type_over
from rulec.passes.downstream import Downstream, Undefined
from rulec.passes.link import Network


class Gathering:
    """Readings of other modules as `downstream(name)`, with the names that types must provide."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._provides = {m.type.name: dict(m.type.provides) for m in self._modules}
        self._known: dict[tuple[str, str], str] = {}

    @property
    def _modules(self) -> list[Module]:
        return list(self._network.plant.modules.values())

    def name(self, module: str, source: str) -> str:
        """The name under which a module gathers this one signal; empty if it cannot."""
        if (module, source) not in self._known:
            self._known[module, source] = self._found(module, source)
        return self._known[module, source]

    def _found(self, module: str, source: str) -> str:
        owner, signal = source.split(".")
        if signal not in self._network.plant.modules[owner].type.signals:
            return ""
        kind = self._network.plant.modules[owner].type.name
        for name, provided in self._provides[kind].items():
            if provided == signal and self._sum(module, name) == ((owner, signal),):
                return name
        name = fresh(f"{signal}_{owner}", {n for own in self._provides.values() for n in own})
        self._provides[kind][name] = signal
        if self._sum(module, name) == ((owner, signal),):
            return name
        del self._provides[kind][name]
        return ""

    def _sum(self, module: str, name: str) -> tuple[tuple[str, str], ...]:
        """What `downstream(name)` sums with the types as they would be."""
        network = self._network
        modules = {m.name: replace(m, type=self._with_provides(m.type)) for m in self._modules}
        plant = replace(network.plant, modules=modules)
        try:
            return Downstream(plant, network.balances, network.graph).sum(module, name)
        except Undefined:
            return ()

    def _with_provides(self, kind: ModuleType) -> ModuleType:
        return replace(kind, provides=self._provides[kind.name])

    def written(self, module: str, amended: Amended) -> Amended:
        """An amended type without names of its own for readings of other modules."""
        table: dict[str, ast.expr] = {}
        for local, source in amended.outside.items():
            argument = name_node(self.name(module, source))
            table[local] = ast.Call(name_node(GATHER), [argument], [])
        kind = type_over(self._with_provides(amended.type), table)
        gathers = {name for e in kind.equations() for name, _ in e.gathered()}
        return replace(amended, type=replace(kind, gathers=tuple(sorted(gathers))), outside={})
