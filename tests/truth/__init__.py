"""Independent truth: recordings of dosing plants, written from physics.

Shares no code with the packages it tests. Files in order of data flow: `units`, `pumps`,
`plant` (what is built and how it is run), `faults`, `network` (the operating point), `sensors`,
`recording` (columns and CSV), `rigs` (ready plants), `runs` (ready runs), `__main__`.
Everything is SI until a sensor reads it; a reading and a CSV are in trade units.
"""

from .faults import possible_faults
from .network import OperatingPoint, solve
from .plant import DosingModule, Line, Mixer, Operation, Plant
from .recording import Recording, record, write_csv
from .rigs import RIGS, abc, mixing_rig, series, three
from .runs import Run, calibration_run, fault_replay, healthy_run, leakage_replay
from .sensors import NOISE_FREE, TABLE_1, Sensing

__all__ = [
    "NOISE_FREE",
    "RIGS",
    "TABLE_1",
    "DosingModule",
    "Line",
    "Mixer",
    "OperatingPoint",
    "Operation",
    "Plant",
    "Recording",
    "Run",
    "Sensing",
    "abc",
    "calibration_run",
    "fault_replay",
    "healthy_run",
    "leakage_replay",
    "mixing_rig",
    "possible_faults",
    "record",
    "series",
    "solve",
    "three",
    "write_csv",
]
