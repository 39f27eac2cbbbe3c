"""Write an amended module type as YAML: its author's file with the changes."""

import math
from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path
from typing import Any

from rulec_runtime.output.open_file import text_of

from rulec.knowledge.module_type import Accuracy, Definition, ModuleType, Parameter, State
from rulec.language.expression import Expression, constant
from rulec.language.read_yaml import Document
from rulec.language.write_yaml import lines, rounded
from rulec.limits import ASSUMED_ACCURACY, MAX_FILE_BYTES

HEAD = "# yaml-language-server: $schema=../schema/module.schema.json"


def write_module(
    document: Document, kind: ModuleType, brought: Mapping[str, Parameter], comments: list[str]
) -> str:
    """Text of the file of an amended type.

    Parameters
    ----------
    document : the old file, from which everything unchanged is taken.
    kind : the amended type.
    brought : parameters that the old type lacked, with their values.
    comments : lines at the top.
    """
    return file_text(Path(document.path), _data(document.data, kind, brought), comments)


def file_text(file: Path, data: Mapping[str, Any], comments: list[str]) -> str:
    """Text of a module type made from the one in `file`, whose head comments it keeps."""
    old = takewhile(lambda line: line.startswith("#"), text_of(file, MAX_FILE_BYTES).splitlines())
    kept = (line for line in old if "yaml-language-server" not in line)
    return "\n".join([HEAD, *(f"# {line}" for line in comments), *kept, *lines(data)]) + "\n"


def _data(
    old: Mapping[str, Any], kind: ModuleType, brought: Mapping[str, Parameter]
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "module": kind.name,
        "version": kind.version,
        "title": kind.title,
        "signals": {
            name: {**entry, "input": True} if kind.signals[name].is_input else entry
            for name, entry in old.get("signals", {}).items()
        },
        "provides": dict(kind.provides),
        "states": {
            name: _state(old.get("states", {}).get(name), state)
            for name, state in kind.states.items()
        },
        "parameters": {
            **old.get("parameters", {}),
            **{name: parameter_entry(p) for name, p in brought.items()},
        },
        "definitions": {
            name: _definition(old.get("definitions", {}).get(name), d)
            for name, d in kind.definitions.items()
        },
        "readings": {
            name: {**part, "is": _equation(part["is"], kind.readings[name].expression)}
            for name, part in old.get("readings", {}).items()
        },
        "observers": {
            name: {**part, "Q": _equation(part["Q"], kind.observers[name].expression)}
            for name, part in old.get("observers", {}).items()
        },
        "residuals": old.get("residuals"),
        "faults": old.get("faults"),
        "regimes": old.get("regimes"),
    }
    for path, accuracy in kind.laws().items():
        group, name = map(str, path)
        entry = data[group][name]
        if "accuracy" not in entry and entry != old.get(group, {}).get(name):
            accuracy = accuracy or Accuracy(ASSUMED_ACCURACY, "[assumed]")
            data[group][name] = {**entry, "accuracy": accuracy.text}
    return {key: value for key, value in data.items() if value}


def parameter_entry(parameter: Parameter) -> dict[str, Any]:
    """A parameter as written in a module type; six digits, calibrations have more."""
    entry: dict[str, Any] = {
        "value": plain_number(parameter.unit.from_si(parameter.value), 6),
        "unit": parameter.unit.text,
        "u": plain_number(parameter.u / parameter.unit.factor, 6),
    }
    if not parameter.fit:
        entry["fit"] = False
    if parameter.highest < math.inf:
        ends = (parameter.lowest, parameter.highest)
        entry["range"] = [plain_number(parameter.unit.from_si(end), 6) for end in ends]
    elif parameter.lowest < 0.0 and not parameter.is_constant:
        entry["sign"] = "any"
    return {**entry, "title": parameter.title, "source": parameter.origin.source or "[assumed]"}


def plain_number(value: float, digits: int) -> float:
    """A number as written in a file: rounded to some digits, an integer if it is whole."""
    value = rounded(value, digits)
    return int(value) if value.is_integer() else value


def _definition(old: Mapping[str, Any] | None, definition: Definition) -> dict[str, Any]:
    if old is None:
        return {"is": definition.expression.text, "title": definition.title}
    return {**old, "is": _equation(old["is"], definition.expression)}


def _state(old: Mapping[str, Any] | None, state: State) -> dict[str, Any]:
    """A state; a new one has no quantity, as no sensor measures it."""
    entry: dict[str, Any] = dict(old or {"unit": state.unit.text})
    for key, expression in state.equations():
        entry[key] = _equation(entry.get(key), expression)
        number = constant(expression, {})
        if key != "der" and number is not None:
            entry[key] = plain_number(number if key == "after" else state.unit.from_si(number), 15)
    if old is None:
        entry |= {"title": state.title, "source": state.origin.source or "[assumed]"}
    return entry


def _equation(old: Any, expression: Expression) -> Any:
    """An equation as its author wrote it, if it is unchanged."""
    return old if str(old) == expression.text else expression.text
