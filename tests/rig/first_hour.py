"""What the machine takes for docs/first-hour.md, and how its story ends under other noise, as JSON.

``python -m tests.rig.first_hour`` runs its commands one after the other, each as a process of its
own, and gives seconds for each step of the page: as a clock sees it, and of the processor alone.
``--again N`` repeats its recordings with the noise of other seeds instead: how many days leave
several explanations open, and of how many of those the planned recording names the truth.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.conftest import ROOT
from tests.figures.share import Share
from tests.page_steps import Typed, Written, steps_of

PAGE = ROOT / "docs" / "first-hour.md"
TRUTH = "slip-viscosity"
PIP = ("--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--target", "site")
AFTER_THE_ANSWER = ("repaired", "compare.py")


def times() -> dict[str, Any]:
    """Seconds for each step of the page, by its number, and of all."""
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for step in _written(Path(folder)):
            number = step.heading.partition(".")[0]
            clock, processor = time.monotonic(), _processor()
            _run(step.command, Path(folder))
            own = found.setdefault(number, {"clock": 0.0, "processor": 0.0})
            own["clock"] += time.monotonic() - clock
            own["processor"] += _processor() - processor
    total = {key: sum(own[key] for own in found.values()) for key in ("clock", "processor")}
    return {"steps": found, "total": total}


def again(count: int) -> dict[str, Any]:
    """The day and the planned recording under other noise."""
    told = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(count):
            for step in _written(folder):
                if any(word in AFTER_THE_ANSWER for word in step.command.split()):
                    continue
                seed = rf"--noise {100 * (number + 1)}\1"
                _run(re.sub(r"--noise (\d+)", seed, step.command), folder)
            told.append([_verdict(folder / file) for file in ("day.json", "both.json")])
            shutil.rmtree(folder / "acme")
            shutil.rmtree(folder / "site")
            print(told[-1], file=sys.stderr)
    open_ = [first for first, _ in told if first[0] == "ambiguous"]
    ends = [both for first, both in told if first[0] == "ambiguous"]
    blamed = sum(sensor for pair in told for *_, sensor in pair)
    return {
        "ambiguous": Share(len(open_), count).form(),
        "named right of these": Share(
            sum(one[:2] == ("named", True) for one in ends), len(ends)
        ).form(),
        "left open": Share(sum(one[0] == "ambiguous" for one in ends), len(ends)).form(),
        "sensor blamed": Share(blamed, 2 * count).form(),
    }


def _verdict(file: Path) -> tuple[str, bool, bool]:
    """What an answer says, whether its first explanation is the truth alone, and whether any sensor
    is blamed."""
    data = json.loads(file.read_text(encoding="utf-8"))
    names = [effect["effect"] for effect in data["effects"]]
    blamed = any(effect["sort"] == "sensor" for effect in data["effects"])
    return data["verdict"], names == [TRUTH], blamed


def _written(folder: Path) -> Iterator[Typed]:
    """The commands of the page; its files are written as it goes on."""
    for step in steps_of(PAGE):
        if isinstance(step, Written):
            (folder / step.file).parent.mkdir(parents=True, exist_ok=True)
            (folder / step.file).write_text(step.text, encoding="utf-8")
        else:
            yield step


def _run(command: str, folder: Path) -> None:
    program, *arguments = shlex.split(command)
    if program == "pip":
        arguments = ["-m", "pip", arguments[0], *PIP, *arguments[1:]]
    elif program != "python":
        arguments = ["-m", program, *arguments]
    paths = [str(folder / "site"), str(ROOT), str(ROOT / "runtime")]
    given = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "RULEC_CACHE": str(folder / "kept"),
    }
    subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=given, check=True, stdout=subprocess.DEVNULL
    )


def _processor() -> float:
    """Seconds that ended child processes had a processor."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--again", type=int, default=0, metavar="N", help="repeat so many times")
    parser.add_argument("--json", help="ignored: this prints JSON alone")
    options = parser.parse_args()
    print(json.dumps(again(options.again) if options.again else times(), indent=2))


if __name__ == "__main__":
    main()
