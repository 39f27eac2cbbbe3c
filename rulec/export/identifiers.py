"""Names that are legal in both C99 and IEC 61131-3.

The IEC standard ignores case and forbids double and trailing underscores, and not every controller
reads more than 32 characters. C accepts all these names except its own words.
"""

from __future__ import annotations

import re

from rulec.export.limits import LONGEST_IDENTIFIER
from rulec.export.program import Kind, Variable

_C = (
    "auto break case char const continue default do double else enum extern float for goto if "
    "inline int long register restrict return short signed sizeof static struct switch typedef "
    "union unsigned void volatile while bool true false exp log sqrt pow fabs fmin fmax in out "
    "abs round floor ceil sin cos tan tanh gamma j0 j1 jn y0 y1 yn isnan isfinite signbit "
    "asm typeof unix linux errno main"
)
"""Words of C99, functions and macros of its library, and the names of our functions' arguments."""

_ST = (
    "abs abstract acos action add and any any_bit any_date any_elementary any_int any_num any_real "
    "any_string array asin at atan bool by byte case class concat configuration constant "
    "continue cos ctd ctu ctud date date_and_time delete deref dint div do dt dword else elsif "
    "end_action end_case end_class end_configuration end_for end_function end_function_block "
    "end_if end_interface end_method end_namespace end_program end_repeat end_resource end_step "
    "end_struct end_transition end_type end_var end_while eq exit exp expt extends f_edge f_trig "
    "false final find for from function function_block ge gt if implements initial_step insert "
    "int interface internal interval ldate ldt le left len limit lint ln log lreal lt ltime ltod "
    "lword max method mid min mod move mul mux namespace ne non_retain not null of on or overlap "
    "override priority private program protected public r_edge r_trig read_only read_write real "
    "ref ref_to repeat replace resource retain return right rol ror rs sel shl shr sin single "
    "sint sqrt sr step string struct sub super tan task then this time time_of_day to tod tof ton "
    "tp transition true trunc type udint uint ulint until using usint var var_access var_config "
    "var_external var_global var_in_out var_input var_output var_temp while with word wstring "
    "xor s r st ld fbd sfc en eno cal calc ret jmp ldn stn"
)
"""Words and standard functions of IEC 61131-3, and operators of its instruction list."""

RESERVED = frozenset((*_C.split(), *_ST.split()))


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
