"""`rulec journal`: what a watched plant told."""

from __future__ import annotations

from rulec_runtime.commands.journal import run

__all__ = ["run"]
