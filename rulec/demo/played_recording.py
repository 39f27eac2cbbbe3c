"""The played recording: the shipped fault-free one repeated, with simulated faults."""

import csv
import io
import socket
from pathlib import Path

from rulec_runtime.output.write_file import write_text

from rulec.demo import limits


def write_inputs(examples: Path, target: Path) -> None:
    """Write `limits.ROWS` rows, 1 s apart, which repeat the fault-free recording."""
    with (examples / "healthy.csv").open(encoding="utf-8", newline="") as file:
        titles, *rows = csv.reader(file)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(titles)
    table.writerows([k, *rows[k % len(rows)][1:]] for k in range(limits.ROWS))
    write_text(target, out.getvalue())


def free_port() -> int:
    """A free port of the loopback interface."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def planted() -> list[str]:
    """Faults as `rulec simulate --fault` takes them."""
    return Path(__file__).with_name("live.faults.txt").read_text(encoding="utf-8").split()
