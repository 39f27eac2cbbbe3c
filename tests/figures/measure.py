"""Figures measured again: a command run, and what it gives written into ledger and pages."""

import datetime
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.conftest import ROOT
from tests.figures.content import content_of
from tests.figures.ledger import Ledger, Measurement
from tests.figures.pages import replaced
from tests.figures.share import Share

LIMIT = 7200.0  # s; the longest command takes half an hour on two cores


def measured_again(measurement: Measurement, ledger: Ledger) -> Measurement:
    """Its values as they are now; raises RuntimeError if the command fails, KeyError if a value is
    not in its JSON."""
    form = output_of(measurement.command)
    return replace(
        measurement,
        values={place: picked(form, place) for place in measurement.values},
        date=datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        commit=_commit(),
        content=content_of(measurement, ledger),
    )


def output_of(command: str) -> Any:
    """Run a command of this project; its JSON. Raises RuntimeError."""
    call = [sys.executable, *shlex.split(command)[1:]]
    done = subprocess.run(
        call, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{command} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout)


def picked(form: Any, place: str) -> float | Share:
    """The value at `a/b/c`; a share has `count` and `of`. Raises KeyError."""
    for word in place.split("/"):
        form = form[int(word)] if isinstance(form, list) else form[word]
    # As many digits as the ledger keeps: pages are checked against these.
    return Share(form["count"], form["of"]) if isinstance(form, Mapping) else float(f"{form:.6g}")


def write(measurement: Measurement, root: Path = ROOT) -> None:
    """Put values, date, commit and content into the ledger, and values into the pages; all else in
    them stays as it is."""
    file = root / "docs" / "figures.yaml"
    file.write_text(_with(measurement, file.read_text(encoding="utf-8")), encoding="utf-8")
    for page, template in measurement.prints:
        text = (root / page).read_text(encoding="utf-8")
        (root / page).write_text(replaced(template, text, measurement.values), encoding="utf-8")


def _with(measurement: Measurement, text: str) -> str:
    """The ledger's text with one measurement's fields replaced."""
    begin = text.index(f"  - id: {measurement.id}\n")
    end = text.index("    prints:\n", begin)
    block, m = text[begin:end], measurement
    fields = {"date": m.date, "commit": f'"{m.commit}"', "content": f'"{m.content}"'}
    fields |= {place: _written(value) for place, value in m.values.items()}
    for name, value in fields.items():
        line = rf"^( +{re.escape(name)}: ).*$"
        block = re.sub(line, rf"\g<1>{value}", block, count=1, flags=re.MULTILINE)
    return text[:begin] + block + text[end:]


def _written(value: float | Share) -> str:
    if isinstance(value, Share):
        return f"{{count: {value.count}, of: {value.of}}}"
    return f"{value:.6g}"


def _commit() -> str:
    """The commit that is checked out, with a + if files differ from it."""
    words = ["git", "describe", "--always", "--abbrev=7", "--dirty=+", "--exclude=*"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"
