"""What it takes to diagnose a recording that is larger than memory.

``python -m tests.rig.long_recording --json -`` writes a CSV file of 2 GB and a Parquet file of the
same readings, diagnoses each in a process of its own, and tells its largest resident memory and its
CPU time. The plant is abc: set points change, and leakages come and go.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests.conftest import compiled

PERIOD, HELD, FAULTY = 100_000, 2000, 1500
"""Rows after which readings repeat, of a set point, and of a fault."""

DEGREE, STARTS = 0.3, (20_500, 50_500, 80_500)

_MEASURED = """
import json, resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps({"peak": used.ru_maxrss / 1024, "cpu": used.ru_utime + used.ru_stime}))
"""
"""Runs a command and tells what it used. A process of its own, and a small one: what runs counts
the memory of the process that starts it as its own."""


def readings(rules: Ruleset, rows: int, random: np.random.Generator) -> dict[str, Array]:
    """Readings by their titles, in the units of their sensors."""
    equations = equations_of(rules)
    given = {}
    for signal in equations.given_signals:
        share = random.uniform(0.85, 1.1, -(-rows // HELD))
        levels = signal.offset + (signal.reference - signal.offset) * share
        given[signal.id] = np.repeat(levels, HELD)[:rows]
    fault = next(f.id for f in rules.faults if not f.in_sensor and not f.unit)
    degree = np.zeros(rows)
    for start in STARTS:
        degree[start : start + FAULTY] = DEGREE
    simulated = simulate_with(equations, given, {fault: degree})
    values = sense(rules, simulated.values, SensorErrors(bounded=True), random)
    signals = rules.signal_by_id
    return {
        f"{name} [{signals[name].unit}]": (column - signals[name].offset) / signals[name].factor
        for name, column in values.items()
        if name in rules.observed
    }


def write(rules: Ruleset, rows: int, csv: Path, parquet: Path | None = None) -> None:
    """The same readings again and again, one row a second, as both kinds of files."""
    made = readings(rules, min(rows, PERIOD), np.random.default_rng(7))
    table = np.column_stack(list(made.values()))
    lines = [",".join(f"{x:.6g}" for x in row) for row in table.tolist()]
    with csv.open("w") as file:
        file.write(",".join(["time [s]", *made]) + "\n")
        for low in range(0, rows, PERIOD):
            count = min(PERIOD, rows - low)
            file.write("".join(f"{low + k},{lines[k]}\n" for k in range(count)))
    if parquet is not None:
        _write_parquet(rows, [*made], lines, parquet)


def _write_parquet(rows: int, titles: list[str], lines: list[str], file: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    fields = [pyarrow.field(title, pyarrow.float64()) for title in ["time [s]", *titles]]
    schema = pyarrow.schema(fields)
    plain = {"compression": "NONE", "use_dictionary": False}
    with pyarrow.parquet.ParquetWriter(file, schema, **plain) as writer:
        for low in range(0, rows, PERIOD):
            count = min(PERIOD, rows - low)
            columns = [low + np.arange(float(count)), *table[:count].T]
            arrays = [pyarrow.array(np.ascontiguousarray(c)) for c in columns]
            writer.write_table(pyarrow.table(arrays, schema=schema))


def measured(ruleset: Path, recording: Path, found: Path) -> dict[str, float]:
    """Largest resident memory, MB, and CPU time, s, of a diagnosis in a process of its own."""
    call = ["rulec_runtime", "diagnose", str(ruleset), str(recording), "--json", str(found)]
    run = [sys.executable, "-c", _MEASURED, sys.executable, "-m", *call]
    told = subprocess.run(run, check=True, stdout=subprocess.PIPE, text=True).stdout
    return {**json.loads(told), "size": recording.stat().st_size / 1e6}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=float, default=2000.0)
    parser.add_argument("--folder", default=None)
    parser.add_argument("--json", default="-")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rulec-long-", dir=options.folder) as name:
        folder = Path(name)
        rules = compiled("abc")
        ruleset, csv, parquet = (folder / f for f in ("abc.json", "long.csv", "long.parquet"))
        ruleset.write_text(rules.to_json(), encoding="utf-8")
        write(rules, PERIOD, csv)
        rows = int(options.megabytes * 1e6 / (csv.stat().st_size / PERIOD + 2))
        write(rules, rows, csv, parquet)
        told: dict[str, Any] = {"rows": rows}
        told["parquet"] = measured(ruleset, parquet, folder / "parquet.json")
        told["csv"] = measured(ruleset, csv, folder / "csv.json")
        texts = [json.loads((folder / f"{kind}.json").read_text()) for kind in ("csv", "parquet")]
        told["findings"] = len(texts[0]["findings"])
        told["same"] = texts[0]["findings"] == texts[1]["findings"]
    text = json.dumps(told, indent=1)
    print(text) if options.json == "-" else Path(options.json).write_text(text + "\n")


if __name__ == "__main__":
    main()
