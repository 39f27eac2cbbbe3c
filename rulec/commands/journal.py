"""`rulec journal`: the events of a watched plant."""

from rulec_runtime.commands.journal import run

__all__ = ["run"]
