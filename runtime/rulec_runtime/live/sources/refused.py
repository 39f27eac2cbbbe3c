"""Refusals of sources."""

from __future__ import annotations

from types import ModuleType

from rulec_runtime.output.refusal import to_install
from rulec_runtime.recordings.csv_table import RecordingRefused


class SourceRefused(RecordingRefused):
    """A source cannot be used; the message says why and what to do."""


def extra(name: str, of: str) -> ModuleType:
    """Import a module of an extra `of` rulec-runtime. Raises `SourceRefused` without it."""
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise SourceRefused(
            f"the package '{name.partition('.')[0]}' is missing: {to_install(of)}"
        ) from None
