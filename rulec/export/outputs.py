"""The names of a routine, and which of them it hands out."""

from __future__ import annotations

from rulec.export.identifiers import Identifiers
from rulec.export.program import Kind, Variable

FLOW = "m3/s"


class Outputs:
    """Grows while a routine is written; `names` are those of all its values."""

    def __init__(self, names: Identifiers) -> None:
        self.names = names
        self.variables: list[Variable] = []

    def number(self, wanted: str, id_: str, text: str, unit: str = FLOW) -> str:
        """A name for an output that is a number."""
        return self._new(wanted, id_, text, unit, "real")

    def flag(self, wanted: str, id_: str, text: str) -> str:
        """A name for an output that is true or false."""
        return self._new(wanted, id_, text, "", "bool")

    def _new(self, wanted: str, id_: str, text: str, unit: str, kind: Kind) -> str:
        name = self.names.new(wanted)
        self.variables.append(Variable(name, id_, kind, unit, text))
        return name
