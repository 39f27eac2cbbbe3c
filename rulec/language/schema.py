"""Check a document against the JSON Schema of its kind; each violation becomes a diagnostic.

A part of a schema may hold its own words under `refusal`: `code`, `message` and `hint`, with the
slots {name} (of the part), {value} (a number), {key} and {lacking} (the required keys that are
missing). The place is the key of a group, or a value; with `at` each key of that list in the group,
or the value `inside`.
"""

import functools
import json
import keyword
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import jsonschema
from rulec_runtime.output.nearest import did_you_mean, nearest

from rulec.language.diagnostics import KINDS, Diagnostic
from rulec.language.limits import MAX_UNKNOWN_KEYS
from rulec.language.read_yaml import Document, Path_
from rulec.language.write_yaml import filled
from rulec.limits import KEPT_DOCUMENTS

_IN_A_PLANT = {"columns": str, "calibration": list}
"""Keys that name a kind of file but also occur in a plant, with another type."""


def kind_of(document: Document) -> str | None:
    """The kind of a file, by its identifying key; None if it has none."""
    data = document.data
    if not isinstance(data, dict):
        return None
    # A plant names its fluid under the key that identifies a fluid's file, so it comes first.
    for kind in ("plant", *KINDS):
        if kind in data and not isinstance(data[kind], _IN_A_PLANT.get(kind, ())):
            return kind
    return None


@functools.lru_cache(maxsize=KEPT_DOCUMENTS)
def check_schema(document: Document, kind: str, schema_folder: Path) -> tuple[Diagnostic, ...]:
    """All schema violations of a document with their places, one for each mistake."""
    errors = list(_validator(schema_folder / f"{kind}.schema.json").iter_errors(document.data))
    seen = {(error.validator, tuple(error.absolute_path)) for error in errors}
    found: list[Diagnostic] = []
    for error in errors:
        path = tuple(error.absolute_path)
        empty = error.validator == "pattern" and ("minLength", path) in seen
        # A part with an unknown key, or of another type, may seem to lack what it should hold.
        unsure = {("additionalProperties", path), ("type", path)} & seen - {(error.validator, path)}
        if not empty and not (unsure and "refusal" in error.schema):
            found += _diagnose(document, kind, error)
    return tuple(found)


@functools.cache
def _validator(path: Path) -> Any:
    schema = json.loads(path.read_text(encoding="utf-8"))
    extend: Any = jsonschema.validators.extend
    kind = extend(jsonschema.Draft202012Validator, {"pattern": _pattern})
    return kind(schema, format_checker=_FORMATS)


_FORMATS = jsonschema.FormatChecker(formats=())
_FORMATS.checks("equation name")(lambda name: not keyword.iskeyword(name))


def _pattern(_: Any, pattern: str, value: Any, __: Any) -> Iterable[jsonschema.ValidationError]:
    """The keyword of JSON Schema, but without line ends, before which Python's `$` also matches."""
    if isinstance(value, str) and ("\n" in value or not re.search(pattern, value)):
        yield jsonschema.ValidationError(f"{value!r} does not match {pattern!r}")


def _diagnose(document: Document, kind: str, error: Any) -> Iterable[Diagnostic]:
    path: Path_ = tuple(error.absolute_path)
    value, limit, where = error.instance, error.validator_value, document.place(*path)
    part = _part(path) if path else f"a {kind} file"
    if "propertyNames" in error.absolute_schema_path:
        yield _bad_name(document, path, error)
        return
    if "refusal" in error.schema:
        yield from _refused(document, path, error)
        return
    match error.validator:
        case "additionalProperties":
            missing = set(error.schema.get("properties", {})) - set(value)
            for key in _unknown(error):
                place = document.key(*path, key)
                hint = _comma(document, path, value, key) or did_you_mean(key, missing)
                yield Diagnostic(place, "KB020", f"'{_clip(key)}' is not a key of {part}", hint)
        case "required":
            yield from _missing(document, path, part, error)
        case "dependentRequired":
            for key, needed in limit.items():
                if key in value and any(name not in value for name in needed):
                    message = f"'{key}' stands there without '{needed[0]}'"
                    hint = f"add '{needed[0]}: ...'"
                    yield Diagnostic(document.key(*path, key), "KB021", message, hint)
        case "type":
            types = " or ".join(_TYPES[t] for t in ([limit] if isinstance(limit, str) else limit))
            message = f"{part} must be {types}, not {_show(value)}"
            needed, examples = error.schema.get("required", ()), ()
            if limit == "string" and "pattern" in error.schema:
                examples = error.schema.get("examples", ())
            hint = _type_hint(limit, value) if not examples else f"as in '{examples[0]}'"
            is_first = len(needed) == 1 and isinstance(value, str)
            is_value = needed[:1] == ["value"] and isinstance(value, int | float)
            if limit == "object" and (is_first or is_value):
                rest = "".join(f", {key}: ..." for key in needed[1:])
                hint = f"write {{{needed[0]}: {_clip(value)}{rest}}}"
            yield Diagnostic(where, "KB022", message, hint)
        case "enum":
            hint = did_you_mean(str(value), map(str, limit))
            yield Diagnostic(where, "KB023", f"{part} cannot be {_show(value)}", hint)
        case "pattern":
            message, hint = f"{part} cannot be {_show(value)}", _form(error.schema)
            yield Diagnostic(where, "KB025", message, hint)
        case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum" as bound:
            message = f"{part} must be {_BOUNDS[bound]} {limit}, not {_show(value)}"
            yield Diagnostic(where, "KB026", message)
        case "minItems" | "maxItems" as bound:
            entries = f"{limit} entr{'ies' if limit > 1 else 'y'}"
            message = f"{part} must have {_BOUNDS[bound]} {entries}, not {len(value)}"
            numbers = all(isinstance(entry, (int, float)) for entry in value)
            hint = "a comma ends a number: write a decimal point" if numbers else ""
            yield Diagnostic(where, "KB027", message, hint if bound == "maxItems" else "")
        case "minProperties" | "minLength":
            hint = "fill it in" if error.validator == "minLength" else "fill it in, or leave it out"
            yield Diagnostic(where, "KB027", f"{part} is empty", hint)
        case _:
            yield Diagnostic(where, "KB025", f"{part}: {_clip(error.message)}")


def _comma(document: Document, path: Path_, part: dict[str, Any], key: str) -> str:
    """Remedy for a key that comes from a comma inside a value, as in {value: 20,5}."""
    before = list(part)[: list(part).index(key)]
    if part[key] is not None or not before:
        return ""
    first = before[-1]
    if document.key(*path, first).line != document.key(*path, key).line:
        return ""
    value = part[first]
    if key[:1].isdigit() and _is_number(key) and type(value) is int:
        return f"between {{ and }} a comma ends a value: write '{first}: {value}.{key}'"
    if isinstance(value, str):
        return f"between {{ and }} a comma ends a value: put the text of '{first}' in quotes"
    return ""


def _unknown(error: Any) -> list[str]:
    """Unknown keys of a part; only the first, as it may be another file altogether."""
    properties = error.schema.get("properties", {})
    return [key for key in error.instance if key not in properties][:MAX_UNKNOWN_KEYS]


def _bad_name(document: Document, path: Path_, error: Any) -> Diagnostic:
    name, group = error.instance, path[-1] if path else ""
    place = document.key(*path, name)
    if error.validator == "enum":
        hint = did_you_mean(name, error.validator_value)
        return Diagnostic(place, "KB020", f"'{_clip(name)}' is not a key of '{group}'", hint)
    if error.validator == "format":
        message = f"'{name}' is a reserved word and cannot be a name"
        return Diagnostic(
            place, "KB024", message, "it could not stand in an equation; use another name"
        )
    legal = "a letter, then at most 40 letters, digits and _"
    hint = "'time', or module.signal as in A.dp" if group == "columns" else legal
    return Diagnostic(place, "KB024", f"'{_clip(name)}' is not a legal name", hint)


def _missing(document: Document, path: Path_, part: str, error: Any) -> Iterable[Diagnostic]:
    """Missing keys of one part, except those that are there but misspelt."""
    value, properties = error.instance, error.schema.get("properties", {})
    typos = {nearest(key, set(properties) - set(value)) for key in _unknown(error)}
    missing = [k for k in error.validator_value if k not in value and k not in typos]
    if not missing:
        return
    at = path or (next(iter(value), ""),)
    names = ", ".join(f"'{key}'" for key in missing)
    message = f"{part} needs the key{'s' * (len(missing) > 1)} {names}"
    about = properties.get(missing[0], {})
    text = about.get("description", about.get("title", "")).rstrip(".")
    hint = f"add '{missing[0]}: ...' ({text})" if len(missing) == 1 else "add them"
    yield Diagnostic(document.key(*at), "KB021", message, hint)


def _refused(document: Document, path: Path_, error: Any) -> Iterable[Diagnostic]:
    """What a part of a schema itself says of a violation."""
    refusal, part = error.schema["refusal"], error.instance
    lacking = [f"'{key}'" for key in error.schema.get("required", ()) if key not in part]
    slots = {"name": _clip(path[-1]) if path else "", "lacking": " and ".join(lacking)}
    slots |= {"value": f"{part:g}"} if isinstance(part, int | float) else {}
    is_group = isinstance(part, dict | list)
    places = {"": document.key(*path) if is_group else document.place(*path)}
    if "inside" in refusal:
        places = {"": document.place(*path, refusal["inside"])}
    elif "at" in refusal:
        places = {key: document.key(*path, key) for key in refusal["at"] if key in part}
    for key, place in places.items():
        message = filled(refusal["message"], {**slots, "key": key})
        yield Diagnostic(place, refusal["code"], message, refusal["hint"])


def _part(path: Path_) -> str:
    """Name a part by its key, which the author sees, not by its title."""
    if isinstance(path[-1], int):
        return f"entry {path[-1] + 1} of {_part(path[:-1])}"
    return f"'{_clip(path[-1])}'"


def _form(schema: dict[str, Any]) -> str:
    if schema.get("examples"):
        return f"as in '{schema['examples'][0]}'"
    extra = "_ and -" if "_-]" in schema["pattern"] else "and _"
    return f"a letter, then letters, digits, {extra}; not too long"


_BOUNDS = {
    "minimum": "at least", "maximum": "at most", "minItems": "at least", "maxItems": "at most",
    "exclusiveMinimum": "more than", "exclusiveMaximum": "less than",
}  # fmt: skip

_TYPES = {
    "object": "a group of keys", "array": "a list", "string": "text", "number": "a number",
    "integer": "a whole number", "boolean": "true or false",
}  # fmt: skip


def _type_hint(kind: Any, value: Any) -> str:
    if kind == "string" and isinstance(value, int | float):
        return "put it in quotes"
    if kind == "array" and not isinstance(value, dict | list):
        return "write [...]"
    if kind == "boolean" and value in ("yes", "no", "on", "off"):
        return "write true or false"
    if kind not in ("number", "integer") or not isinstance(value, str):
        return ""
    if _is_number(value):
        return "remove the quotes"
    if _is_number(value.replace(",", ".")):
        return "write a decimal point, not a comma"
    if _is_number(value.rstrip("% ")):
        return "no percentage, but a number in the unit of this entry"
    if _is_number(value.split(" ")[0]):
        return "the number alone; its unit has a key of its own"
    return ""


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _show(value: Any) -> str:
    if isinstance(value, dict):
        return "a group of keys"
    if isinstance(value, list):
        return "a list"
    if value is None:
        return "nothing"
    return f"'{_clip(value)}'" if isinstance(value, str) else _clip(json.dumps(value))


def _clip(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."
