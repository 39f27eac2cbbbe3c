"""Samples of the waste-water station that are settled, as JSON: `python -m tests.rig.hsy`."""

import json

from tests.conftest import recordings_folder
from tests.rig.station import judge

if __name__ == "__main__":
    settled = judge(recordings_folder()).settled
    print(json.dumps({"samples": len(settled), "settled": int(settled.sum())}))
