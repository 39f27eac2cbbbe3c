"""YAML of a map with places: each error names the file, the line and what to write instead."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.refused import SourceRefused, extra
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.open_file import begin_of


class Entry:
    """A node of a map, with its place."""

    def __init__(self, path: Path, node: Any, name: str) -> None:
        self._path, self._node, self.name = path, node, name

    @property
    def place(self) -> str:
        return f"{self._path}, line {self._node.start_mark.line + 1}"

    def refused(self, text: str) -> SourceRefused:
        return SourceRefused(f"{self.place}: {text}")

    @property
    def is_text(self) -> bool:
        return bool(self._node.id == "scalar")

    def text(self) -> str:
        """A scalar that is not empty."""
        value = str(self._node.value).strip() if self.is_text else ""
        if not value:
            raise self.refused(f"'{self.name}' needs a single value")
        return value

    def one_of(self, known: tuple[str, ...]) -> str:
        text = self.text()
        if text not in known:
            raise self.refused(f"'{self.name}' is one of {', '.join(known)}")
        return text

    def number(self, least: float = -float("inf")) -> float:
        try:
            value = float(self.text())
        except ValueError:
            value = float("nan")
        if not isfinite(value) or value < least:
            bound = f" of {least:g} or more" if isfinite(least) else ""
            raise self.refused(f"'{self.name}' needs a number{bound}")
        return value

    def items(self, known: Iterable[str] | None = None) -> Mapping[str, Entry]:
        """Entries by key; raises `SourceRefused` for a key that is not `known`."""
        if self._node.id != "mapping":
            raise self.refused(f"'{self.name}' needs entries such as 'key: value'")
        found: dict[str, Entry] = {}
        for key, value in self._node.value:
            name = str(key.value) if key.id == "scalar" else ""
            here = Entry(self._path, key, name)
            if not name or name in found:
                raise here.refused(f"'{name}' stands twice" if name else "a key must be a name")
            if known is not None and name not in known:
                raise here.refused(f"unknown key '{name[:40]}'; {did_you_mean(name, known)}")
            found[name] = Entry(self._path, value, name)
        return found


def read_entries(path: Path, extra_of: str) -> Entry:
    """The root of a map. Raises `SourceRefused`."""
    yaml = extra("yaml", extra_of)
    try:
        data = begin_of(path, limits.LARGEST_MAP + 1)
    except OSError as error:
        raise SourceRefused(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > limits.LARGEST_MAP:
        raise SourceRefused(f"{path}: a map has less than {limits.LARGEST_MAP} bytes")
    if data.strip() and b"signals" not in data:  # never quote a foreign file
        raise SourceRefused(f"{path}: this is no map; it needs 'signals:'")
    try:
        node = yaml.compose(data.decode("utf-8-sig"), Loader=yaml.SafeLoader)
    except UnicodeDecodeError:
        raise SourceRefused(f"{path}: this is not UTF-8") from None
    except RecursionError:
        raise SourceRefused(f"{path}: it is nested too deep") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        why = getattr(error, "problem", None) or "it cannot be read"
        raise SourceRefused(f"{path}{where}: this is not YAML: {why}") from None
    if node is None:
        raise SourceRefused(f"{path}: the map is empty; it needs 'signals:'")
    return Entry(path, node, "map")
