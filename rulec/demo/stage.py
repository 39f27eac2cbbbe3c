"""What is played: the shipped fault-free recording over and over, with faults simulated in it."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from rulec_runtime.output.write_file import write_text

from rulec.demo import limits

HEALTHY = "healthy.csv"
FAULTS = "live.faults.txt"


def write_inputs(examples: Path, target: Path) -> None:
    """`limits.ROWS` rows a second apart, of the rows of the fault-free recording in turn."""
    with (examples / HEALTHY).open(encoding="utf-8", newline="") as file:
        titles, *rows = csv.reader(file)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(titles)
    table.writerows([k, *rows[k % len(rows)][1:]] for k in range(limits.ROWS))
    write_text(target, out.getvalue())


def planted() -> list[str]:
    """Faults as `rulec simulate --fault` takes them."""
    return Path(__file__).with_name(FAULTS).read_text(encoding="utf-8").split()
