"""Independent truth: recordings of dosing plants, written from physics.

It shares no code with the packages it tests. Files in order of data flow: `units`, `formulas` (in
tables), `sensors`, `settled.rig` (kinds of pumps), `settled.solve` (the operating point); of ready
dosing plants: `plant` (and its operation), `faults`, `rigs`, `runs`, `recording` (columns and CSV),
`__main__`. For the proof: `streams` (random numbers), `smooth` (form errors, coloured noise,
drifts), `whiten`, `detection_limit` (detectability at best), `sealed` (the form of a case and its
answer), `kinds` (of cases), `settled` and `tanks` (cases of plants in stationary operation, and of
plants that store liquid). Everything is SI until a sensor reads it; readings and CSV files are in
trade units.
"""

from .faults import possible_faults
from .plant import Operation, Plant
from .recording import Recording, record, write_csv
from .rigs import RIGS
from .runs import (
    VALVE_TIME,
    Run,
    calibration_run,
    fault_replay,
    healthy_run,
    leakage_replay,
    operating_points,
    settling,
    visiting_run,
    warm_run,
)
from .sensors import INSIDE, NOISE_FREE, TABLE_1, Sensing

__all__ = [
    "INSIDE",
    "NOISE_FREE",
    "RIGS",
    "TABLE_1",
    "VALVE_TIME",
    "Operation",
    "Plant",
    "Recording",
    "Run",
    "Sensing",
    "calibration_run",
    "fault_replay",
    "healthy_run",
    "leakage_replay",
    "operating_points",
    "possible_faults",
    "record",
    "settling",
    "visiting_run",
    "warm_run",
    "write_csv",
]
