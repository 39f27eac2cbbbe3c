"""What grows over the days of a plant, below its threshold on each of them."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from rulec_runtime.fleet.plant_day import Row, Task, judge_day

from rulec.fleet.trends import Trend, trends_of
from tests.dosing import healthy_run, record
from tests.method.readings import built, calibrated, ruleset

DAYS, SAMPLES = 30, 60
FIRST = datetime(2026, 3, 1, 8, tzinfo=UTC)


def judged(folder: Path, fault: str, largest: float, seed: int) -> tuple[list[Row], list[Trend]]:
    """Rows of the days of a plant with a fault that grows evenly, and what grows over them."""
    text = calibrated(ruleset("abc")).to_json()
    run = healthy_run(built("abc"), DAYS * SAMPLES)
    degree = np.repeat(largest * np.arange(DAYS) / (DAYS - 1), SAMPLES)
    made = record(replace(run, faults={fault: degree} if fault else {}), seed=seed).readings
    names = [name for name in made if name != "time [s]"]
    rows = []
    for day in range(DAYS):
        lines = [",".join(["time", *names])]
        for i in range(SAMPLES):
            date = FIRST + timedelta(days=day, seconds=i)
            cells = (f"{made[name][day * SAMPLES + i]:.6g}" for name in names)
            lines.append(",".join([date.isoformat(), *cells]))
        file = folder / f"{day}.csv"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        task = Task(
            plant="P1",
            day=f"{FIRST + timedelta(days=day):%Y-%m-%d}",
            files=(str(file),),
            marks=(),
            ruleset="r",
            trace=False,
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
