"""Samples of the waste-water station that are settled, as JSON: `python -m tests.rig.hsy`."""

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

from tests.conftest import compiled, recordings_folder

PLANT = "hsy-pumping"
FILE = Path("hsy-wastewater-pumping") / "hsy_15min.csv"


def recorded(folder: Path) -> Recording:
    return read_recording(folder / FILE, compiled(PLANT))


def settled_of(recording: Recording) -> NDArray[np.bool_]:
    """Samples in settled stretches, shape (n,)."""
    noise = noise_at_work(recording, compiled(PLANT))
    stretches = find_stretches(recording, compiled(PLANT), noise)
    settled = np.zeros(len(recording), dtype=bool)
    for first, last in zip(stretches.first, stretches.last, strict=True):
        settled[first:last] = True
    return settled


if __name__ == "__main__":
    settled = settled_of(recorded(recordings_folder()))
    print(json.dumps({"samples": len(settled), "settled": int(settled.sum())}))
