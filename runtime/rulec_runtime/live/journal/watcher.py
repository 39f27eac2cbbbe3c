"""The watcher of a plant: one process at a time, named by a row of the journal.

Every transaction of a watcher checks that row first, so a watcher that was presumed dead cannot
write any more.
"""

import os
import secrets
import socket
import sys
from dataclasses import dataclass, field
from pathlib import Path

import sqlalchemy as sa

from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.event_records import name_of
from rulec_runtime.live.journal.refused import JournalRefused
from rulec_runtime.live.journal.tables import WATCHERS, clock, insert


def _read(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _machine() -> str:
    """Identifies the machine, whose processes can be checked; a container counts as a machine."""
    try:
        space = os.readlink("/proc/self/ns/pid")
    except OSError:
        space = ""
    return name_of(f"{socket.gethostname()} {_read('/proc/sys/kernel/random/boot_id')} {space}")


def _process(pid: int | str) -> str:
    """Unique id of a process: its number, which may be reused, with its start time."""
    fields = _read(f"/proc/{pid}/stat").rpartition(")")[2].split()
    return f"{pid} {fields[19]}" if len(fields) > 19 else f"{pid}"


@dataclass(frozen=True)
class Watcher:
    """This watcher, as others see it."""

    token: str = field(default_factory=lambda: secrets.token_hex(16))
    machine: str = field(default_factory=_machine)
    process: str = field(default_factory=lambda: _process(os.getpid()))

    def take_lease(self, connection: sa.Connection, plant: str, address: str) -> None:
        """Take or renew the lease of the plant, within a transaction.

        Raises `JournalRefused` while another watcher holds it.
        """
        now = clock(connection)
        mine = {
            "plant": plant,
            "token": self.token,
            "machine": self.machine,
            "process": self.process,
            "name": name_of(f"process {os.getpid()} on {socket.gethostname()}"),
            "expires": now + limits.LEASE,
        }
        connection.execute(insert(connection, WATCHERS).values(mine).on_conflict_do_nothing())
        row = connection.execute(
            sa.select(WATCHERS).where(WATCHERS.c.plant == plant).with_for_update()
        ).one()
        if row.token != self.token and self._lives(row, now):
            raise JournalRefused(
                f"{plant} is watched already: {row.name} writes into {address}; one watcher at a "
                f"time. If it is dead, its place is free after {limits.LEASE:g} s"
            )
        connection.execute(WATCHERS.update().where(WATCHERS.c.plant == plant).values(mine))

    def left(self, connection: sa.Connection, plant: str) -> None:
        """Give up the lease."""
        mine = (WATCHERS.c.plant == plant) & (WATCHERS.c.token == self.token)
        connection.execute(WATCHERS.delete().where(mine))

    def _lives(self, row: sa.Row, now: float) -> bool:  # type: ignore[type-arg]
        if row.machine == self.machine and sys.platform == "linux":
            return bool(_process(row.process.partition(" ")[0]) == row.process)
        # An expiry far ahead means that the clock was set back.
        return bool(now < row.expires <= now + 2 * limits.LEASE)
