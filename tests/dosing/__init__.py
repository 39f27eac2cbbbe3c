"""Dosing plants of the independent truth with faults, in runs as tests need them.

Files in order of data flow: `plant` (and its operation), `rigs` (ready plants), `faults`, `runs`
(ready runs), `recording`, and the command that makes the recordings which ship with plants. The
laws and the solver are those of `rulec.prove.truth.settled`. Everything is SI until a sensor reads
it; readings and CSV files are in trade units.
"""

from rulec.prove.truth.recording import write_csv
from rulec.prove.truth.sensors import INSIDE, NOISE_FREE, TABLE_1, Sensing
from tests.dosing.faults import possible_faults
from tests.dosing.plant import Operation, Plant
from tests.dosing.recording import record
from tests.dosing.rigs import RIGS
from tests.dosing.runs import (
    Run,
    calibration_run,
    fault_replay,
    healthy_run,
    operating_points,
    settling,
    visiting_run,
)
