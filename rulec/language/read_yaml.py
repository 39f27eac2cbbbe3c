"""Read YAML with the position of every key and value.

Scalars follow the YAML 1.2 core schema (`1e-3` is a number, `no` is text). Duplicate keys, anchors,
aliases, tags, numbers too large or too small, and more than one document are refused.
"""

import codecs
import functools
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from rulec_runtime.output.nearest import near_file
from rulec_runtime.output.open_file import begin_of

from rulec.language.diagnostics import (
    KINDS,
    Diagnostic,
    Place,
    Refused,
    is_ours,
    no_file_of_ours,
    split_lines,
)
from rulec.language.limits import MAX_FILE_NUMBER, MAX_INTEGER_DIGITS, MAX_NESTING
from rulec.limits import KEPT_DOCUMENTS, MAX_FILE_BYTES

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_INTEGER = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_CONTROL = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_STEERING = re.compile(
    "[\0-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters (C0, C1), direction marks and surrogates: an escape in double quotes can write
them, and a terminal would obey them."""

_QUOTING = ("KB005", "KB008", "KB013")
"""Mistakes that quote the file; a file that is not ours must not be quoted."""

_WORDS: dict[str, bool | None] = {"null": None, "Null": None, "NULL": None, "~": None, "": None}
_WORDS |= {"true": True, "True": True, "TRUE": True}
_WORDS |= {"false": False, "False": False, "FALSE": False}

Path_ = tuple[str | int, ...]


@dataclass(frozen=True, eq=False)
class Document:
    """A YAML file as plain data, which is never changed, with the place of each part.

    `path` is the file's name for the user. `label` is its name in a ruleset, with its last folders
    only, so that a ruleset does not depend on where it was compiled. `data` consists of dict, list,
    str, int, float, bool and None. `values` and `keys` map a path such as ``("signals", "dp",
    "unit")`` to the place of the value and of its key.
    """

    path: str
    label: str
    data: Any
    values: Mapping[Path_, Place] = field(repr=False)
    keys: Mapping[Path_, Place] = field(repr=False)

    def place(self, *path: str | int) -> Place:
        """Place of a value; if it is absent, of the nearest enclosing part."""
        for end in range(len(path), -1, -1):
            if path[:end] in self.values:
                return self.values[path[:end]]
        return Place(self.path)

    def key(self, *path: str | int) -> Place:
        """Place of a key; falls back to the value."""
        return self.keys.get(path) or self.place(*path)


def read_document(path: Path) -> tuple[Document | None, list[Diagnostic]]:
    """Read one YAML file; the document is None if there is a mistake."""
    name = display(path)
    try:
        raw = begin_of(path, MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        near = near_file(path)
        hint = f"did you mean '{near}'?" if near else "`rulec init plant NAME` makes a new plant"
        message = "there is no such file or folder"
        return None, [Diagnostic(Place(name), "KB001", message, hint)]
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return None, [Diagnostic(Place(name), "KB001", f"cannot read this file: {reason}")]
    if len(raw) > MAX_FILE_BYTES:
        message = f"the file has more than {MAX_FILE_BYTES / 1e6:g} MB"
        return None, [Diagnostic(Place(name), "KB002", message, "is this really a YAML file?")]
    raw = raw.removeprefix(codecs.BOM_UTF8)
    document, found = _decoded(name, raw)
    if any(one.code in _QUOTING for one in found) and not is_ours(raw.decode(errors="replace")):
        return None, [no_file_of_ours(Place(name))]
    return document, found


def _decoded(name: str, raw: bytes) -> tuple[Document | None, list[Diagnostic]]:
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        before = split_lines(raw[: error.start].decode("utf-8"))
        message = f"byte {raw[error.start]:#04x} is not UTF-8"
        place = Place(name, len(before), len(before[-1]) + 1)
        return None, [Diagnostic(place, "KB003", message, "save the file as UTF-8")]
    return parse_document(name, text)


def parse_document(name: str, text: str) -> tuple[Document | None, list[Diagnostic]]:
    """Parse YAML text that is already in memory; the same text gives the same document."""
    document, found = _parsed(name, text)
    return document, list(found)


@functools.lru_cache(maxsize=KEPT_DOCUMENTS)
def _parsed(name: str, text: str) -> tuple[Document | None, Sequence[Diagnostic]]:
    bad = _CONTROL.search(text)
    if bad is not None:
        before = split_lines(text[: bad.start()])
        place = Place(name, len(before), len(before[-1]) + 1)
        message = f"not YAML: there is a control character ({ord(bad[0]):#04x})"
        return None, [Diagnostic(place, "KB004", message, "delete it")]
    try:
        _refuse_events(name, text)
        node = yaml.compose(text, Loader=_Loader)
    except Refused as refused:
        return None, refused.diagnostics
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        return None, [_syntax(name, text, error)]
    if node is None:
        kind = Path(name).stem if Path(name).stem in KINDS else "module"
        hint = f"start it with what it describes, as in '{kind}: my-{kind}'"
        return None, [Diagnostic(Place(name), "KB006", "the file is empty", hint)]
    builder = _Builder(name)
    data = builder.build(node, ())
    if builder.found:
        return None, builder.found
    return Document(name, _label(name), data, builder.values, builder.keys), []


def _refuse_events(name: str, text: str) -> None:
    """Refuse some legal constructs before composing: an alias bomb must not even be built."""
    documents = depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        mark = event.start_mark
        anchor, tag = getattr(event, "anchor", None), getattr(event, "tag", None)
        if anchor:
            message = "anchors and aliases are refused"
            hint = "write the value out: each number stands where it is used"
            raise Refused([Diagnostic(_at(name, mark, len(anchor) + 1), "KB007", message, hint)])
        if tag:
            short = tag.replace("tag:yaml.org,2002:", "!!")
            message, hint = f"the tag '{short}' is refused", "write plain text or a number"
            raise Refused([Diagnostic(_at(name, mark, len(short)), "KB008", message, hint)])
        if isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                message, hint = "a second document starts here", "put it into a file of its own"
                raise Refused([Diagnostic(_at(name, mark, 3), "KB009", message, hint)])
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > MAX_NESTING:
                raise Refused([Diagnostic(_at(name, mark), "KB010", *_TOO_DEEP)])
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


_SYNTAX = {
    "mapping values are not allowed": (
        "a colon where no key can be",
        "text with a colon needs quotes; keys of one group start in the same column",
    ),
    "could not find expected ':'": ("this line is no key", "write 'key: value'"),
    "cannot start any token": (
        "no text can start with this character",
        "text that starts with it needs quotes",
    ),
    "expected node content": ("something is missing here", "a value, or a closing bracket"),
    "did not find expected ','": (
        "a comma or a closing bracket is missing before this",
        "close the bracket that was opened before",
    ),
    "did not find expected key": (
        "this does not belong here",
        "keys of one group start in the same column; is a quote or bracket too many?",
    ),
    "block sequence entries": (
        "a list cannot start here",
        "start it on its own line, or use [...]",
    ),
    "unexpected end of stream": ("what starts here never ends", "is a closing quote missing?"),
    "escape character": ("a backslash in double quotes", "use single quotes"),
}


_TOO_DEEP = f"this is nested more than {MAX_NESTING} deep", "no file of this tool needs that"


def _syntax(name: str, text: str, error: Exception) -> Diagnostic:
    """The mistake that the YAML reader found, with a remedy for the usual slips."""
    problem = getattr(error, "problem", None) or str(error).split("\n")[0]
    mark, context = getattr(error, "problem_mark", None), getattr(error, "context_mark", None)
    lines = split_lines(text.rstrip())
    end = Place(name, len(lines), len(lines[-1]) + 1)
    place = end if mark is None else min(_at(name, mark), end)
    second = None
    if context is not None and context.line + 1 != place.line:
        if place == end:
            place = min(_at(name, context), end)
        elif "," in problem:
            second = _at(name, context)
    if "expected ':'" in problem and context is not None:
        place = _at(name, context)  # the end of the line above, without its colon, is read on
    # Some releases of the YAML reader refuse extreme nesting before they give any event.
    if "maximum nesting depth" in problem:
        return Diagnostic(place, "KB010", *_TOO_DEEP)
    plain = (text for part, text in _SYNTAX.items() if part in problem)
    message, hint = next(plain, (problem, "check indent and quotes"))
    if lines[place.line - 1][place.column - 1 : place.column] == "\t":
        message, hint = "there is a tab", "indent with spaces, not with tabs"
    return Diagnostic(place, "KB004", f"not YAML: {message}", hint, second)


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
        """Plain data of a node; its place is stored under its path."""
        self.values[path] = _at(self.name, node.start_mark, _length(node))
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*path, i)) for i, item in enumerate(node.value)]
        self._refuse_steering(node)
        value = node.value if node.style else _scalar(node.value)
        if (
            isinstance(value, int | float)
            and value
            and not 1 / MAX_FILE_NUMBER <= abs(value) <= MAX_FILE_NUMBER
        ):
            message = f"no value in a plant can be {node.value[:40]}"
            hint = f"0, or a number of size {1 / MAX_FILE_NUMBER:.0e} to {MAX_FILE_NUMBER:.0e}"
            self.found.append(Diagnostic(self.values[path], "KB013", message, hint))
        return value

    def _refuse_steering(self, node: Any) -> None:
        steering = _STEERING.search(node.value)
        if steering:
            message = f"this text holds the control character U+{ord(steering[0]):04X}"
            place = _at(self.name, node.start_mark, _length(node))
            self.found.append(Diagnostic(place, "KB014", message, "write what can be read only"))

    def _mapping(self, node: Any, path: Path_) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            place = _at(self.name, key_node.start_mark, _length(key_node))
            if not isinstance(key_node, yaml.ScalarNode):
                hint = "text that starts with { or [ needs quotes"
                self.found.append(Diagnostic(place, "KB011", "a key must be plain text", hint))
                continue
            self._refuse_steering(key_node)
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
    if _INTEGER.fullmatch(text) and len(text) < MAX_INTEGER_DIGITS:
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text)
    if text.lower() in (".inf", "+.inf", "-.inf", ".nan"):
        return float(text.replace(".", ""))
    return text


def _length(node: Any) -> int:
    start, end = node.start_mark, node.end_mark
    return max(1, int(end.column - start.column)) if start.line == end.line else 1


def _label(path: str) -> str:
    """The part of a path from `kb` or `plants` on, or its last two parts."""
    parts = Path(path).resolve().parts
    for root in ("kb", "plants"):
        if root in parts:
            start = len(parts) - 1 - parts[::-1].index(root)
            return "/".join(parts[start:])
    return "/".join(parts[-2:])


def display(path: Path) -> str:
    """Path as shown to the user: relative to the working folder where possible."""
    try:
        return Path(os.path.realpath(path)).relative_to(Path.cwd()).as_posix()
    except ValueError:
        return path.as_posix()
