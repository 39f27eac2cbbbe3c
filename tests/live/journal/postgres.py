"""A PostgreSQL server of our own, in a folder of its own, that can be stopped and started."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

PROGRAMS = sorted(Path("/usr/lib/postgresql").glob("*/bin"))


class Postgres:
    """It listens at a socket in its folder alone."""

    def __init__(self) -> None:
        if not PROGRAMS:
            pytest.skip("no server of PostgreSQL in /usr/lib/postgresql")
        self._programs = PROGRAMS[-1]
        self.folder = Path(tempfile.mkdtemp(prefix="rulec-pg-", dir="/tmp"))
        # The server refuses to be run by root.
        self._user = "nobody" if os.geteuid() == 0 else None
        if self._user:
            shutil.chown(self.folder, self._user)
        self.url = f"postgresql+psycopg://rulec@/postgres?host={self.folder}"
        data = str(self.folder / "data")
        self._run("initdb", "-D", data, "-U", "rulec", "-A", "trust", "--no-sync", "-E", "UTF8")
        self.start()

    def start(self) -> None:
        # Processes are killed here, never the computer: nothing need reach the disk, and a server
        # that starts again after that does not bring all of its files there first.
        options = f"-c listen_addresses='' -k {self.folder} -c shared_buffers=8MB -c fsync=off"
        self._pg_ctl("start", "-l", str(self.folder / "log"), "-o", options)

    def stop(self) -> None:
        """As when somebody restarts it: who is connected is thrown out."""
        self._pg_ctl("stop", "-m", "immediate")

    def close(self) -> None:
        self._pg_ctl("stop", "-m", "immediate", check=False)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _pg_ctl(self, *arguments: str, check: bool = True) -> None:
        self._run("pg_ctl", "-w", "-D", str(self.folder / "data"), *arguments, check=check)

    def _run(self, program: str, *arguments: str, check: bool = True) -> None:
        done = subprocess.run(
            [str(self._programs / program), *arguments],
            user=self._user,
            cwd="/",
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
        )
        assert not check or done.returncode == 0, (program, arguments)
