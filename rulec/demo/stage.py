"""What is played: the shipped fault-free recording over and over, with faults simulated in it."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.write_file import write_text, written
from rulec_runtime.recordings.recording_file import read_file

from rulec.demo import limits
from rulec.simulation.predict import predict
from rulec.simulation.prediction import Injected
from rulec.simulation.rewrite import rewrite

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


def write_played(ruleset: Ruleset, inputs: Path, faults: Sequence[Injected], target: Path) -> None:
    """The recording that `rulec simulate --noise` makes of inputs."""
    file = read_file(inputs, ruleset, [])
    values = predict(ruleset, [file], faults, limits.NOISE).values
    with written(target) as out:
        rewrite(file, ruleset, values, out)
