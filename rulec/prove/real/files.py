"""Text files that may be compressed (`.gz`), and YAML; the same text gives the same bytes."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from rulec_runtime.output.write_file import write_data, write_text

from rulec.language.document import read_document


def opened(file: Path) -> IO[str]:
    """Open a text file, compressed or not."""
    if file.suffix == ".gz":
        return gzip.open(file, "rt", encoding="utf-8", newline="")
    return file.open(encoding="utf-8", newline="")


def write_packed(file: Path, text: str) -> None:
    """Write a text, compressed if the name ends in `.gz`."""
    data = text.encode()
    write_data(file, gzip.compress(data, mtime=0) if file.suffix == ".gz" else data)


def yaml_of(file: Path) -> dict[str, Any]:
    """Return the data of a YAML file that was checked before."""
    document, _ = read_document(file)
    assert document is not None
    return dict(document.data)


def write_yaml(file: Path, data: Mapping[str, Any]) -> None:
    """Write JSON, which is YAML: numbers and texts stay as they were read."""
    write_text(file, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
