"""Read YAML with the position of every key and value.

YAML 1.2 core scalars (`1e-3` is a number, `no` is text). Duplicate keys, anchors, aliases, tags
and more than one document are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rulec.diagnostics import Diagnostic, Place

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

MAX_BYTES = 4_000_000
MAX_DEPTH = 24

_INTEGER = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS = {"null": None, "Null": None, "NULL": None, "~": None, "": None}
_WORDS |= {"true": True, "True": True, "TRUE": True}
_WORDS |= {"false": False, "False": False, "FALSE": False}

Path_ = tuple[str | int, ...]


@dataclass(frozen=True)
class Document:
    """A YAML file as plain data plus where each part stands.

    `path` is how the user names the file, `label` how a ruleset does: with its last folders, so
    that a ruleset does not depend on where it was compiled. `data` holds dict, list, str, int, float, bool, None. `values` and `keys` map a path such as
    ``("signals", "dp", "unit")`` to the place of the value and of its key.
    """

    path: str
    label: str
    data: Any
    values: Mapping[Path_, Place] = field(repr=False)
    keys: Mapping[Path_, Place] = field(repr=False)

    def place(self, *path: str | int) -> Place:
        """Place of a value; of the nearest enclosing part where it is absent."""
        for end in range(len(path), -1, -1):
            if path[:end] in self.values:
                return self.values[path[:end]]
        return Place(self.path)

    def key(self, *path: str | int) -> Place:
        """Place of a key; falls back to the value."""
        return self.keys.get(path) or self.place(*path)


def read_document(path: Path) -> tuple[Document | None, list[Diagnostic]]:
    """Read one YAML file; on a mistake the document is None."""
    name = _display(path)
    try:
        raw = path.read_bytes()
    except OSError as error:
        reason = error.strerror or "cannot be read"
        return None, [Diagnostic(Place(name), "KB001", f"cannot read this file: {reason}")]
    if len(raw) > MAX_BYTES:
        message = f"the file has {len(raw)} bytes; at most {MAX_BYTES} are read"
        return None, [Diagnostic(Place(name), "KB002", message, "is this really a YAML file?")]
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        message = f"byte {raw[error.start]:#04x} is not UTF-8"
        return None, [Diagnostic(Place(name, line), "KB003", message, "save the file as UTF-8")]
    return parse_document(name, text)


def parse_document(name: str, text: str) -> tuple[Document | None, list[Diagnostic]]:
    """Parse YAML text that is already in memory."""
    try:
        _refuse_events(text)
        node = yaml.compose(text, Loader=_Loader)
    except _Unwanted as unwanted:
        return None, [Diagnostic(_at(name, unwanted.mark), *unwanted.reason)]
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        return None, [_syntax(name, error)]
    if node is None:
        return None, [Diagnostic(Place(name), "KB006", "the file is empty")]
    builder = _Builder(name)
    data = builder.build(node, ())
    if builder.found:
        return None, builder.found
    return Document(name, _label(name), data, builder.values, builder.keys), []


class _Unwanted(Exception):
    def __init__(self, mark: Any, *reason: str) -> None:
        self.mark, self.reason = mark, reason


def _refuse_events(text: str) -> None:
    """Refuse before composing: an alias bomb must not even be built."""
    documents = depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _Unwanted(
                event.start_mark,
                "KB007",
                "anchors and aliases are refused",
                "write the value out: each number stands where it is used",
            )
        if getattr(event, "tag", None):
            raise _Unwanted(event.start_mark, "KB008", f"the tag '{event.tag}' is refused")
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise _Unwanted(
                    event.start_mark, "KB009", "a second document starts here", "one file, one"
                )
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise _Unwanted(event.start_mark, "KB010", f"nested deeper than {MAX_DEPTH}")
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _syntax(name: str, error: Exception) -> Diagnostic:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    problem = getattr(error, "problem", None) or str(error).split("\n")[0]
    place = _at(name, mark) if mark is not None else Place(name)
    return Diagnostic(place, "KB004", f"not YAML: {problem}", "check indent, colons and quotes")


def _at(name: str, mark: Any, length: int = 1) -> Place:
    return Place(name, mark.line + 1, mark.column + 1, length)


@dataclass
class _Builder:
    """Turns composed nodes into plain data, collecting places and mistakes."""

    name: str
    values: dict[Path_, Place] = field(default_factory=dict)
    keys: dict[Path_, Place] = field(default_factory=dict)
    found: list[Diagnostic] = field(default_factory=list)

    def build(self, node: Any, path: Path_) -> Any:
        self.values[path] = _at(self.name, node.start_mark, _length(node))
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*path, i)) for i, item in enumerate(node.value)]
        return node.value if node.style else _scalar(node.value)

    def _mapping(self, node: Any, path: Path_) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            place = _at(self.name, key_node.start_mark, _length(key_node))
            if not isinstance(key_node, yaml.ScalarNode):
                self.found.append(Diagnostic(place, "KB011", "a key must be plain text"))
                continue
            key = key_node.value
            where = (*path, key)
            if key in result:
                message = f"the key '{key}' stands twice"
                second = self.keys[where]
                self.found.append(Diagnostic(place, "KB005", message, "keep one", second))
                continue
            self.keys[where] = place
            result[key] = self.build(value_node, where)
        return result


def _scalar(text: str) -> Any:
    """Resolve a plain scalar by the YAML 1.2 core schema.

    >>> [_scalar(t) for t in ("1e-3", "no", "12:30", "0o14", "true")]
    [0.001, 'no', '12:30', '0o14', True]
    """
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) and len(text) < 300:
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text)
    if text.lower() in (".inf", "+.inf", "-.inf", ".nan"):
        return float(text.replace(".", ""))
    return text


def _length(node: Any) -> int:
    if node.start_mark.line == node.end_mark.line:
        return max(1, node.end_mark.column - node.start_mark.column)
    return 1


def _label(path: str) -> str:
    """The part of a path from `kb` or `plants` on, or its last two parts."""
    parts = Path(path).resolve().parts
    for root in ("kb", "plants"):
        if root in parts:
            start = len(parts) - 1 - parts[::-1].index(root)
            return "/".join(parts[start:])
    return "/".join(parts[-2:])


def _display(path: Path) -> str:
    """Path as shown to the user: relative to the working folder where possible."""
    try:
        return path.resolve().relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()
