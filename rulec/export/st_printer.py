"""Print the code of a module as IEC 61131-3 structured text: a function block for each routine."""

from collections.abc import Iterable, Iterator, Sequence

from rulec.export.layout import LEVELS, PLAIN_SIGNS, WIDTH, broken, literal, wrapped
from rulec.export.program import Apply, Expression, ModuleCode, Name, Number, Routine, Variable

SIGNS = {**PLAIN_SIGNS, "and": "AND"}
FUNCTIONS = {"sqrt": "SQRT", "exp": "EXP", "log": "LN", "abs": "ABS", "pow": "EXPT"}
FUNCTIONS |= {"min": "MIN", "max": "MAX"}
TYPES = {"real": "LREAL", "bool": "BOOL"}


def blocks(code: ModuleCode) -> str:
    """The function blocks of a module."""
    lines = [*_comment(code.head), ""]
    for routine in code.routines:
        lines += [
            *_comment([routine.text]),
            f"FUNCTION_BLOCK {code.name}_{routine.name}",
            *_variables(routine),
        ]
        lines += [*_body(routine), "END_FUNCTION_BLOCK", ""]
    return "\n".join(lines)


def _variables(routine: Routine) -> Iterator[str]:
    outputs = {v.name for v in routine.outputs}
    yield from _declared("VAR_INPUT", routine.inputs)
    yield from _declared("VAR_OUTPUT", routine.outputs)
    if routine.parameters:
        yield "VAR CONSTANT"
        for p in routine.parameters:
            line = f"{p.name} : LREAL := {literal(p.value)}; (* {_plain(p.text)} *)"
            yield from broken(line, "    ")
        yield "END_VAR"
    yield "VAR"
    values = (s for s in routine.statements if s.name not in outputs)
    yield from (f"    {s.name} : {TYPES[s.kind]};" for s in values)
    yield "END_VAR"


def _declared(kind: str, variables: Sequence[Variable]) -> Iterator[str]:
    yield kind
    for v in variables:
        unit = f"[{v.unit}] " if v.unit else ""
        line = f"{v.name} : {TYPES[v.kind]}; (* {_plain(unit + v.text)} *)"
        yield from broken(line, "    ")
    yield "END_VAR"


def _body(routine: Routine) -> Iterator[str]:
    for section in routine.sections:
        yield ""
        yield from broken(f"(* {_plain(section.title)} *)", "")
        for s in section.statements:
            comment = f" (* {_plain(s.comment)} *)" if s.comment else ""
            yield from broken(f"{s.name} := {_text(s.expression)};{comment}", "")


def _text(expression: Expression, level: int = 0) -> str:
    """An expression; in brackets if the expression around it binds as strongly."""
    match expression:
        case Number(value) if value < 0 and level > 0:
            return f"({literal(value)})"
        case Number(value):
            return literal(value)
        case Name(name):
            return name
        case Apply("neg", (a,)):
            return f"-{_text(a, 5)}" if level == 0 else f"(-{_text(a, 5)})"
        case Apply("not", (a,)):
            return f"NOT ({_text(a)})"
        case Apply("select", (condition, a, b)):
            return f"SEL({_text(condition)}, {_text(b)}, {_text(a)})"
        case Apply(name, operands) if name in FUNCTIONS:
            return f"{FUNCTIONS[name]}({', '.join(_text(e) for e in operands)})"
        case Apply(name, (a, b)):
            own = LEVELS[name]
            right = own if name == "and" else own + 1
            text = f"{_text(a, own)} {SIGNS[name]} {_text(b, right)}"
            return f"({text})" if own < level else text
    raise ValueError(f"no structured text for {expression}")


def _comment(lines: Iterable[str]) -> list[str]:
    parts = [part for line in lines for part in wrapped(_plain(line), WIDTH - 2)]
    return ["(*", *(f"  {part}".rstrip() for part in parts), "*)"]


def _plain(text: str) -> str:
    """ASCII text without the ends of a comment."""
    return text.encode("ascii", "replace").decode().replace("*)", "* )").replace("(*", "( *")
