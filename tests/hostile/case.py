"""A hostile input: files in a folder, and a command that is run there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Content = str | bytes


@dataclass(frozen=True)
class Case:
    """Files by name, and the arguments of `rulec`, which is started in their folder.

    `{kb}`, `{plants}` and `{rules}` in an argument or a text stand for what is shipped.
    """

    family: str
    name: str
    arguments: tuple[str, ...]
    files: Mapping[str, Content] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return f"{self.family}: {self.name}".encode("ascii", "backslashreplace").decode()

    def lay_out(self, folder: Path) -> None:
        """Write all files."""
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            raw = content if isinstance(content, bytes) else content.encode()
            path.write_bytes(raw)
        for name, target in self.links.items():
            (folder / name).symlink_to(target)


def sealed(data: Mapping[str, Any]) -> str:
    """A ruleset with the right digest: its author knows how it is made."""
    plain = {k: v for k, v in data.items() if k != "digest"}
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return json.dumps({**plain, "digest": hashlib.sha256(text.encode()).hexdigest()})
