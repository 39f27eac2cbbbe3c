"""What grows over the days of a plant, below its threshold on each of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rulec_runtime.fleet.plant_day import Row, Task, judge_day

from rulec.fleet.trends import Trend, trends_of
from tests.dosing import healthy_run, record
from tests.method.readings import built, calibrated, ruleset

DAYS, SAMPLES = 30, 60
FIRST = np.datetime64("2026-03-01T08:00:00")


def judged(folder: Path, fault: str, largest: float, seed: int) -> tuple[list[Row], list[Trend]]:
    """Rows of the days of a plant with a fault that grows evenly, and what grows over them."""
    text = calibrated(ruleset("abc")).to_json()
    run = healthy_run(built("abc"), DAYS * SAMPLES)
    degree = np.repeat(largest * np.arange(DAYS) / (DAYS - 1), SAMPLES)
    faults = {fault: degree} if fault else {}
    made = dict(record(replace(run, faults=faults), seed=seed).readings)
    del made["time [s]"]
    rows = []
    for day in range(DAYS):
        begin = FIRST + np.timedelta64(day, "D")
        times = begin + np.arange(SAMPLES).astype("m8[s]")
        part = slice(day * SAMPLES, (day + 1) * SAMPLES)
        file = str(folder / f"{day}.parquet")
        pq.write_table(pa.table({"time": times, **{n: v[part] for n, v in made.items()}}), file)
        task = Task(
            plant="P1", day=str(begin)[:10], files=(file,), marks=(), ruleset="r", trace=False
        )
        rows.append(judge_day(task, text))
    return rows, [*trends_of(rows, {"r": text})]


def test_a_leakage_below_its_threshold_on_most_days_is_seen(tmp_path: Path) -> None:
    """From 0 to 2.5 %: where the classes of sensors allow more, single days say nothing."""
    rows, (trend,) = judged(tmp_path, "A.leakage", 0.025, 8600)
    assert 20 <= [row["status"] for row in rows].count("ok")
    assert ("P1", "A.leakage", "A") == (trend.plant, trend.fault, trend.module)
    assert trend.growth["now"]["lower"] <= 0.025 <= trend.growth["now"]["upper"]
    assert "1/d" == trend.growth["rate"]["unit"]
    assert trend.growth["rate"]["lower"] <= 0.025 / DAYS <= trend.growth["rate"]["upper"]
    assert "per day" in trend.text


def test_nothing_grows_in_a_sound_plant(tmp_path: Path) -> None:
    """A month with the errors that the classes of sensors allow."""
    rows, trends = judged(tmp_path, "", 0.0, 8601)
    assert ({"ok"}, []) == ({row["status"] for row in rows}, trends)
