"""`rulec journal`: the events of a watched plant."""

from __future__ import annotations

from rulec_runtime.commands.journal import run

__all__ = ["run"]
