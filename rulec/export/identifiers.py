"""Names that are legal in both C99 and IEC 61131-3.

The IEC standard ignores case and forbids double and trailing underscores, and not every controller
reads more than 32 characters. C accepts all these names except its own words.
"""

import re
from pathlib import Path

from rulec.export.limits import LONGEST_IDENTIFIER

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
