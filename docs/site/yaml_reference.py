"""The page of all keys of YAML files, from the schemas that `rulec check` uses."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

SCHEMAS = Path(__file__).parents[2] / "kb" / "schema"
ORDER = ("plant", "module", "fault", "effect", "sensor", "fluid", "units", "columns", "calibration")
ANY = "NAME"
"""Stands for a name that the author of the file chooses."""

Schema = Mapping[str, Any]


def yaml_page() -> str:
    """Markdown with a section per kind of file: a table of its keys."""
    files = {f.name.partition(".")[0]: f for f in sorted(SCHEMAS.glob("*.json"))}
    kinds = sorted(files, key=lambda kind: (kind not in ORDER, *_place(kind), kind))
    parts = [
        "# YAML files",
        "Keys of each kind of file, as `rulec check` wants them and an editor completes them."
        f" `{ANY}` is a name that you choose; a key in bold must be there.",
    ]
    for kind in kinds:
        schema = json.loads(files[kind].read_text(encoding="utf-8"))
        parts += [f"## {schema['title']}", *_said(schema)]
        rows = [_row(path, key, required) for path, key, required in _keys(schema, ())]
        parts.append("\n".join(["| key | value | meaning |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def _place(kind: str) -> tuple[int, ...]:
    return (ORDER.index(kind),) if kind in ORDER else (len(ORDER),)


def _said(schema: Schema) -> list[str]:
    said = [schema["description"]] if "description" in schema else []
    choices = [option["description"] for option in _options(schema) if "description" in option]
    return said + choices


def _options(schema: Schema) -> list[Schema]:
    return [*schema.get("oneOf", ()), *schema.get("anyOf", ())]


def _keys(schema: Schema, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Schema, bool]]:
    """Keys of a schema and of what is in them, in the order of the file."""
    required = schema.get("required", ())
    for name, inner in schema.get("properties", {}).items():
        if isinstance(inner, dict):
            yield (*path, name), inner, name in required
            yield from _keys(inner, (*path, name))
    others = schema.get("additionalProperties")
    if isinstance(others, dict):
        if path or "title" in others:
            yield (*path, ANY), others, False
        yield from _keys(others, (*path, ANY))
    items = schema.get("items")
    if isinstance(items, dict):
        yield from _keys(items, (*path[:-1], f"{path[-1]}[]") if path else ("[]",))
    for option in _options(schema):
        if option.get("type") in ("object", "array"):
            yield from _keys(option, path)


def _row(path: tuple[str, ...], schema: Schema, required: bool) -> str:
    key = f"`{'.'.join(path)}`"
    meaning = [schema.get("title", ""), schema.get("description", "")]
    text = ": ".join(part.rstrip(".") for part in meaning if part)
    default = f"; default {_code(schema['default'])}" if "default" in schema else ""
    examples = schema.get("examples", [])[:1]
    shown = f", such as {_code(examples[0])}" if examples else ""
    return (
        f"| {f'**{key}**' if required else key} | {_kind(schema)}{shown}{default} | {_cell(text)} |"
    )


def _kind(schema: Schema) -> str:
    """The values that a key takes, in words."""
    if "enum" in schema:
        return " or ".join(_code(value) for value in schema["enum"])
    if "const" in schema:
        return _code(schema["const"])
    if options := _options(schema):
        named = dict.fromkeys(_kind(option) for option in options)
        return " or ".join(kind for kind in named if kind)
    kinds = schema.get("type", "")
    words = {"object": "keys", "array": "list", "boolean": "true or false", "string": "text"}
    words["integer"] = "whole number"
    return " or ".join(words.get(k, k) for k in ([kinds] if isinstance(kinds, str) else kinds))


def _code(value: Any) -> str:
    return f"`{_cell(json.dumps(value, ensure_ascii=False))}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
