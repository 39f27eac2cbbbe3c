"""Print the code of a module as C99: a header and a file of plain functions on structs."""

import re
from collections.abc import Iterator, Sequence

from rulec.export.layout import LEVELS, PLAIN_SIGNS, WIDTH, broken, literal, wrapped
from rulec.export.program import Apply, Expression, ModuleCode, Name, Number, Routine, Variable

SIGNS = {**PLAIN_SIGNS, "and": "&&"}
FUNCTIONS = {"sqrt": "sqrt", "exp": "exp", "log": "log", "abs": "fabs", "pow": "pow"}
FUNCTIONS |= {"min": "fmin", "max": "fmax"}
TYPES = {"real": "double", "bool": "bool"}


def header(code: ModuleCode) -> str:
    """The header of a module."""
    guard = f"{code.name.upper()}_OBSERVERS_H"
    lines = [*_comment(code.head), "", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += ["#include <stdbool.h>", ""]
    for routine in code.routines:
        lines += _struct(f"{code.name}_{routine.name}_in", routine.inputs)
        lines += _struct(f"{code.name}_{routine.name}_out", routine.outputs)
        lines += [*_comment([routine.text]), f"{_prototype(code, routine)};", ""]
    return "\n".join([*lines, "#endif", ""])


def source(code: ModuleCode) -> str:
    """The functions of a module."""
    lines = [*_comment(code.head), "", f'#include "{code.name}.h"', "", "#include <math.h>", ""]
    for routine in code.routines:
        lines += [_prototype(code, routine), "{", *_body(routine), "}", ""]
    return "\n".join(lines[:-1]) + "\n"


def _prototype(code: ModuleCode, routine: Routine) -> str:
    name = f"{code.name}_{routine.name}"
    return f"void {name}(const struct {name}_in *in, struct {name}_out *out)"


def _struct(name: str, variables: Sequence[Variable]) -> list[str]:
    lines = [f"struct {name} {{"]
    for v in variables:
        unit = f" [{v.unit}]" if v.unit else ""
        text = f"{TYPES[v.kind]} {v.name}; /*{_plain(unit)} {_plain(v.text)} */"
        lines += broken(text, "    ")
    return [*lines, "};", ""]


def _body(routine: Routine) -> Iterator[str]:
    members = {v.name: f"in->{v.name}" for v in routine.inputs}
    outputs = {v.name: f"out->{v.name}" for v in routine.outputs}
    members |= outputs
    for p in routine.parameters:
        line = f"const double {p.name} = {literal(p.value)}; /* {_plain(p.text)} */"
        yield from broken(line, "    ")
    for section in routine.sections:
        yield ""
        yield from broken(f"/* {_plain(section.title)} */", "    ")
        for s in section.statements:
            target = outputs.get(s.name) or f"const {TYPES[s.kind]} {s.name}"
            text = f"{target} = {_text(s.expression, members)};"
            comment = f" /* {_plain(s.comment)} */" if s.comment else ""
            yield from broken(text + comment, "    ")


def _text(expression: Expression, members: dict[str, str], level: int = 0) -> str:
    """An expression; in brackets if the expression around it binds as strongly."""
    match expression:
        case Number(value):
            return literal(value)
        case Name(name):
            return members.get(name, name)
        case Apply("neg", (a,)):
            return f"-{_text(a, members, 5)}"
        case Apply("not", (a,)):
            return f"!({_text(a, members)})"
        case Apply("select", (condition, a, b)):
            text = f"{_text(condition, members, 1)} ? {_text(a, members, 1)} : {_text(b, members)}"
            return f"({text})" if level > 0 else text
        case Apply(name, operands) if name in FUNCTIONS:
            return f"{FUNCTIONS[name]}({', '.join(_text(e, members) for e in operands)})"
        case Apply(name, (a, b)):
            own = LEVELS[name]
            right = own if name == "and" else own + 1
            text = f"{_text(a, members, own)} {SIGNS[name]} {_text(b, members, right)}"
            return f"({text})" if own < level else text
    raise ValueError(f"no C for {expression}")


def _comment(lines: Sequence[str]) -> list[str]:
    parts = [part for line in lines for part in wrapped(_plain(line), WIDTH - 3)]
    return ["/*", *(f" * {part}".rstrip() for part in parts), " */"]


def _plain(text: str) -> str:
    """ASCII text without trigraphs and without the ends of a comment."""
    without_trigraphs = re.sub(r"\?(?=\?)", "? ", text.encode("ascii", "replace").decode())
    return without_trigraphs.replace("*/", "* /").replace("/*", "/ *")
