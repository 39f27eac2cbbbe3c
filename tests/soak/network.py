"""A network that loses packets, and one that falls silent with both ends still connected."""

import random
import time
from pathlib import Path
from typing import Any

from tests.soak import lossy, score
from tests.soak.plant import course
from tests.soak.sources import STEP, Served, of_connection, watched
from tests.soak.watching import Watch

LOSS = 0.3
LOSSY = 120.0  # s with that loss
CALM = 30.0  # s without, afterwards
PATIENCE = 90.0


def through(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """OPC UA or MQTT over such a network."""
    with lossy.spaces() as there:
        if not there:
            return {"skipped": "network namespaces and TUN devices need root"}
        link = lossy.Link()
        try:
            return _watched(kind, folder, times, link)
        finally:
            came, dropped = link.close()
            print(f"{came} packets, {dropped} dropped")


def _watched(kind: str, folder: Path, times: int, link: lossy.Link) -> dict[str, Any]:
    seconds = LOSSY + CALM + times * 60.0 + 60.0
    draw, what = random.Random(6), course(folder, int(seconds / STEP), 200, 100)
    served = Served(kind, folder, lossy.HOST, 4840)
    served.before = lossy.inside(lossy.PLANT)
    served.watched_from = lossy.inside(lossy.WATCHER)
    watch, start = watched(folder, what, served)
    told: list[float | None] = []
    again: list[float | None] = []
    try:
        time.sleep(15.0)
        before = watch.rows
        link.says(f"loss {LOSS}")
        time.sleep(LOSSY)
        link.says("loss 0")
        after = watch.rows
        time.sleep(CALM)
        of_loss, reads = of_connection(watch.events), watch.rows > after
        for _ in range(times):
            time.sleep(draw.uniform(3.0, 6.0))
            link.says("silent")
            told.append(_until(watch, "told_lost"))
            link.says("loss 0")
            again.append(_until(watch, "read_again"))
        end = time.time()
        code = watch.interrupt()
    finally:
        if watch.runs:
            watch.kill()
        served.kill()
    return {
        "loss": LOSS,
        "rows_with_loss": after - before,
        "rows_without_loss": round(LOSSY / STEP),
        "reads_after_loss": reads,
        **{f"{name}_with_loss": n for name, n in of_loss.items()},
        "tried": times,
        "told_silent": sum(s is not None for s in told),
        "longest_until_told": max((s for s in told if s is not None), default=None),
        "survived": sum(s is not None for s in again) if code == 0 else 0,
        "longest_until_read_again": max((s for s in again if s is not None), default=None),
        **score.outcome(watch.events, what.at(start, STEP), end, watch.said),
    }


def _until(watch: Watch, what: str) -> float | None:
    """Seconds until one more is told; none if never."""
    known, began = of_connection(watch.events)[what], time.monotonic()
    while (lasts := time.monotonic() - began) < PATIENCE:
        if of_connection(watch.events)[what] > known:
            return round(lasts, 1)
        time.sleep(0.2)
    return None
