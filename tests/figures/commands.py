"""Figures measured again: each command once for all figures that it gives."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

from tests.conftest import ROOT
from tests.figures.ledger import Figure
from tests.figures.share import Share
from tests.figures.sources import HOOK, environment, used

LIMIT = 7200.0  # s; the longest command takes half an hour on two cores


@dataclass(frozen=True)
class Measured:
    """A value; with a count if it is a share."""

    value: float
    count: int | None = None
    of: int | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """Of a share by its count, of other values nothing but the value."""
        if self.count is None or self.of is None:
            return self.value, self.value
        return Share(self.count, self.of).interval


def output_of(command: str) -> tuple[Any, tuple[str, ...]]:
    """Run a command of this project; its JSON, and the files that it used. Raises RuntimeError."""
    with tempfile.TemporaryDirectory() as folder:
        note = Path(folder) / "used"
        note.touch()
        paths = [str(HOOK), *filter(None, [os.environ.get("PYTHONPATH")])]
        done = subprocess.run(
            [sys.executable, "-m", *_words(command)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
            env={**os.environ, **environment(note), "PYTHONPATH": os.pathsep.join(paths)},
        )
        if done.returncode:
            raise RuntimeError(f"{command} failed:\n{done.stderr[-2000:]}")
        return json.loads(done.stdout), used(note)


def output_here(command: str) -> Any:
    """The same by the command's main, in this process, which has read and imported much already."""
    module, *options = _words(command)
    main = importlib.import_module(f"{module}.__main__").main
    out = io.StringIO()
    with mock.patch.object(sys, "argv", [module, *options]), contextlib.redirect_stdout(out):
        main()
    return json.loads(out.getvalue())


def _words(command: str) -> list[str]:
    """Module and options."""
    words = shlex.split(command)
    if words[:2] != ["python", "-m"]:
        raise RuntimeError(f"no command that can be run: {command}")
    return words[2:]


def picked(form: Any, key: str) -> Measured:
    """The value at `a/b/c`; a share has `value`, `count` and `of`. Raises KeyError."""
    for word in key.split("/"):
        form = form[int(word)] if isinstance(form, list) else form[word]
    if isinstance(form, Mapping):
        return Measured(float(form["value"]), int(form["count"]), int(form["of"]))
    return Measured(float(form))


def updated(figure: Figure, found: Measured, commit: str, date: str, content: str) -> Figure:
    """The figure with a new value; a tolerance keeps its width."""
    low, high = found.interval
    if found.count is None:
        low, high = (
            round(found.value + end - figure.value, 9) for end in (figure.low, figure.high)
        )
    return replace(
        figure,
        value=round(found.value, 6),
        low=min(low, found.value),
        high=max(high, found.value),
        count=found.count,
        of=found.of,
        commit=commit,
        date=date,
        content=content,
    )


def quick_verdict(figure: Figure, found: Measured) -> str:
    """Empty if a small measurement agrees with what is printed; else what is wrong.

    A share agrees if the printed one lies in the interval of the small count, so that few
    samples prove little; another value if it lies in the interval of the ledger.
    """
    if found.count is not None:
        low, high = found.interval
        if low <= figure.value <= high:
            return ""
        return (
            f"{figure.id}: printed {figure.value:.3g}; today {found.count} of {found.of}, "
            f"{low:.3f} to {high:.3f}"
        )
    if figure.low <= found.value <= figure.high:
        return ""
    return (
        f"{figure.id}: printed {figure.value:.4g} ({figure.low:.4g} to {figure.high:.4g}); "
        f"today {found.value:.4g}"
    )
