"""`watch` as a process, while a look at everything goes on beside the rows."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.conftest import ROOT
from tests.live.test_watch import LEAKAGE, environment

WATCH = """
import signal
import sys
from rulec_runtime.live import limits

if __name__ == "__main__":
    # Whoever runs the tests in the background has interrupts ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    limits.SMALL_PLANT = 5
    from rulec_runtime.cli import main

    raise SystemExit(main(sys.argv[1:]))
"""


def children(pid: int) -> list[int]:
    """Processes that one has started for looks."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(c) for c in listed if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def holds_interrupts(pid: int) -> bool:
    """Is a process still starting another one?"""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (mask,) = [int(line.split()[1], 16) for line in lines if line.startswith("SigBlk:")]
    return bool(mask >> (signal.SIGINT - 1) & 1)


def test_an_interrupt_waits_for_no_look(rules: Path, tmp_path: Path) -> None:
    log, script = tmp_path / "log.csv", tmp_path / "watch.py"
    script.write_text(WATCH, encoding="utf-8")
    lines = LEAKAGE.read_text(encoding="utf-8").splitlines(keepends=True)
    log.write_text("".join(lines[:5]), encoding="utf-8")
    command = [sys.executable, str(script), "watch", str(rules), "--source", str(log)]
    watch = subprocess.Popen(
        command, cwd=ROOT, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        row, started = 5, list[int]()
        while not started and row < len(lines):
            with log.open("a", encoding="utf-8") as out:
                out.write(lines[row])
            row += 1
            time.sleep(0.3)
            started = children(watch.pid)
        (look,) = started
        # Interrupted while it starts one, the watch would end before it is asked for anything.
        while holds_interrupts(watch.pid):
            time.sleep(0.01)
        os.kill(look, signal.SIGSTOP)  # a look that never ends
        since = time.monotonic()
        watch.send_signal(signal.SIGINT)
        out_text, _ = watch.communicate(timeout=10)
        assert time.monotonic() - since < 3.0
        assert watch.returncode == 0, out_text
        assert b"Traceback" not in out_text
        assert not Path(f"/proc/{look}").exists()
    finally:
        watch.kill()
        watch.wait()
