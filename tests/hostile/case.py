"""A hostile input: files in a folder, and a command that is run there."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Content = str | bytes


def _large(path: Path) -> None:
    """A terabyte that takes no room."""
    with path.open("wb") as file:
        file.truncate(2**40)


ODD: dict[str, Callable[[Path], None]] = {
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a folder": Path.mkdir,
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a terabyte": _large,
}
"""What may stand in the place of a file."""


@dataclass(frozen=True)
class Case:
    """Files by name, and the arguments of `rulec`, which is started in their folder.

    `links` lead somewhere, `odd` are no files. `{plants}` and `{rules}` in an argument stand for
    what is shipped.
    """

    family: str
    name: str
    arguments: tuple[str, ...]
    files: Mapping[str, Content] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    odd: Mapping[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return f"{self.family}: {self.name}".encode("ascii", "backslashreplace").decode()

    def lay_out(self, folder: Path) -> None:
        for name in (*self.files, *self.links, *self.odd):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        for name, content in self.files.items():
            raw = content if isinstance(content, bytes) else content.encode()
            (folder / name).write_bytes(raw)
        for name, target in self.links.items():
            (folder / name).symlink_to(target)
        for name, kind in self.odd.items():
            ODD[kind](folder / name)


def sealed(data: Mapping[str, Any]) -> str:
    """A ruleset with the right digest: its author knows how it is made."""
    plain = {k: v for k, v in data.items() if k != "digest"}
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return json.dumps({**plain, "digest": hashlib.sha256(text.encode()).hexdigest()})
