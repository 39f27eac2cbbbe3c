"""A routine while it is written: statement after statement, section after section."""

from rulec.export.identifiers import Identifiers
from rulec.export.program import (
    Expression,
    Kind,
    Name,
    Parameter,
    Routine,
    Section,
    Statement,
    Variable,
    without_unused,
)

FLOW = "m3/s"


class Draft:
    """Inputs, statements and outputs so far. `names` are those of all its values."""

    def __init__(self) -> None:
        self.names = Identifiers()
        self.inputs: list[Variable] = []
        self._outputs: list[Variable] = []
        self._sections: list[Section] = []
        self._statements: list[Statement] = []

    def state(
        self, name: str, expression: Expression, kind: Kind = "real", comment: str = ""
    ) -> Name:
        """Calculate a value under a name of `names`."""
        self._statements.append(Statement(name, expression, kind, comment))
        return Name(name)

    def output(self, wanted: str, id_: str, text: str, unit: str = FLOW) -> str:
        """Declare an output that is a number and stated next; returns its name."""
        name = self.names.new(wanted)
        self._outputs.append(Variable(name, id_, "real", unit, text))
        return name

    def number(self, wanted: str, id_: str, text: str, value: Expression, unit: str = FLOW) -> Name:
        """Add an output that is a number."""
        return self.state(self.output(wanted, id_, text, unit), value)

    def flag(self, wanted: str, id_: str, text: str, value: Expression) -> Name:
        """Add an output that is true or false."""
        name = self.names.new(wanted)
        self._outputs.append(Variable(name, id_, "bool", "", text))
        return self.state(name, value, "bool")

    def section(self, title: str) -> None:
        """End a section: what was stated since the last one."""
        self._sections.append(Section(title, tuple(self._statements)))
        self._statements = []

    def routine(self, name: str, text: str, parameters: tuple[Parameter, ...]) -> Routine:
        """All sections, without statements and parameters that no output needs."""
        whole = Routine(
            name=name,
            text=text,
            inputs=tuple(self.inputs),
            parameters=parameters,
            sections=tuple(self._sections),
            outputs=tuple(self._outputs),
        )
        return without_unused(whole)
