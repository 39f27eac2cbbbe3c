"""Check a document against the JSON Schema of its kind; every violation becomes a diagnostic."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import jsonschema

from rulec.diagnostics import Diagnostic, did_you_mean
from rulec.document import Document

KINDS = ("module", "fault", "sensor", "fluid", "plant", "columns", "calibration", "units")


def kind_of(document: Document) -> str | None:
    """Which kind of file this is, by its first distinguishing key; None if none fits."""
    if not isinstance(document.data, dict):
        return None
    return next((kind for kind in KINDS if kind in document.data), None)


def check_schema(document: Document, kind: str, schema_folder: Path) -> list[Diagnostic]:
    """All schema violations of a document, with their places."""
    errors = _validator(schema_folder / f"{kind}.schema.json").iter_errors(document.data)
    return [found for error in errors for found in _diagnose(document, error)]


@functools.cache
def _validator(path: Path) -> Any:
    schema = json.loads(path.read_text(encoding="utf-8"))
    return jsonschema.Draft202012Validator(schema)


def _diagnose(document: Document, error: Any) -> Iterable[Diagnostic]:
    path = tuple(error.absolute_path)
    value, where = error.instance, document.place(*path)
    title = error.schema.get("title", "this")
    match error.validator:
        case "additionalProperties":
            known = error.schema.get("properties", {})
            for key in sorted(set(value) - set(known)):
                hint = did_you_mean(key, set(known) - set(value))
                place = document.key(*path, key)
                yield Diagnostic(place, "KB020", f"'{key}' is not a key of this part", hint)
        case "required":
            missing = [k for k in error.validator_value if k not in value]
            spot = document.key(*path) if path else where
            for key in missing:
                hint = f"add '{key}: ...'"
                yield Diagnostic(spot, "KB021", f"the key '{key}' is missing here", hint)
        case "type":
            wanted = _wanted(error.validator_value)
            yield Diagnostic(where, "KB022", f"{title}: {_show(value)} is not {wanted}")
        case "enum":
            hint = did_you_mean(str(value), map(str, error.validator_value))
            yield Diagnostic(where, "KB023", f"{title}: {_show(value)} is not a choice here", hint)
        case "pattern" if "propertyNames" in error.absolute_schema_path:
            yield Diagnostic(
                document.key(*path, value),
                "KB024",
                f"'{_clip(value)}' is not a legal name",
                "a letter, then letters, digits and _",
            )
        case "pattern":
            examples = error.schema.get("examples")
            hint = f"as in '{examples[0]}'" if examples else "a letter, then letters, digits, _, -"
            yield Diagnostic(where, "KB025", f"{title}: '{_clip(value)}' has the wrong form", hint)
        case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum":
            yield Diagnostic(where, "KB026", f"{title}: {value} is out of bounds", error.message)
        case "minItems" | "maxItems" | "minProperties" | "minLength":
            yield Diagnostic(where, "KB027", f"{title}: too few or too many entries here")
        case "oneOf":
            hint = "either law and degree, or variants"
            yield Diagnostic(where, "KB028", "this fault has no law, or two", hint)
        case _:
            yield Diagnostic(where, "KB025", f"{title}: {error.message[:120]}")


def _wanted(kind: Any) -> str:
    words = {
        "object": "a group of keys",
        "array": "a list",
        "string": "text",
        "number": "a number",
        "integer": "a whole number",
        "boolean": "true or false",
    }
    kinds = [kind] if isinstance(kind, str) else kind
    return " or ".join(words[k] for k in kinds)


def _show(value: Any) -> str:
    if isinstance(value, dict):
        return "a group of keys"
    if isinstance(value, list):
        return "a list"
    if value is None:
        return "nothing"
    return f"'{_clip(value)}'"


def _clip(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."
