"""Names that are legal in both C99 and IEC 61131-3.

The IEC standard ignores case and forbids double and trailing underscores, and not every controller
reads more than 32 characters. C accepts all these names except its own words.
"""

import re
from pathlib import Path

from rulec.export.limits import LONGEST_IDENTIFIER
from rulec.export.program import Kind, Variable

_WORDS = Path(__file__).with_name("reserved_words.txt").read_text(encoding="utf-8")
RESERVED = frozenset(re.sub("(?m)^#.*", "", _WORDS).split())


class Identifiers:
    """Hands out names that differ from each other even if case is ignored."""

    def __init__(self, reserved: frozenset[str] = RESERVED) -> None:
        self._taken: set[str] = set()
        self._reserved = reserved

    def new(self, wanted: str) -> str:
        """A legal name as close to the wanted one as possible.

        >>> names = Identifiers()
        >>> names.new("P_el.high"), names.new("p_el__high"), names.new("exp"), names.new("2nd")
        ('P_el_high', 'p_el_high_2', 'exp_value', 'v_2nd')
        """
        name = "_".join(re.findall(r"[A-Za-z0-9]+", wanted)) or "v"
        name = name if name[0].isalpha() else f"v_{name}"
        name = name[:LONGEST_IDENTIFIER].rstrip("_")
        number = 1
        tried = f"{name}_value" if name.lower() in self._reserved else name
        while tried.lower() in self._taken:
            number += 1
            tail = f"_{number}"
            tried = name[: LONGEST_IDENTIFIER - len(tail)].rstrip("_") + tail
        self._taken.add(tried.lower())
        return tried


FLOW = "m3/s"


class Outputs:
    """The outputs of a routine while it is written. `names` are those of all its values."""

    def __init__(self, names: Identifiers) -> None:
        self.names = names
        self.variables: list[Variable] = []

    def number(self, wanted: str, id_: str, text: str, unit: str = FLOW) -> str:
        """Add an output that is a number; returns its name."""
        return self._new(wanted, id_, text, unit, "real")

    def flag(self, wanted: str, id_: str, text: str) -> str:
        """Add an output that is true or false; returns its name."""
        return self._new(wanted, id_, text, "", "bool")

    def _new(self, wanted: str, id_: str, text: str, unit: str, kind: Kind) -> str:
        name = self.names.new(wanted)
        self.variables.append(Variable(name, id_, kind, unit, text))
        return name
