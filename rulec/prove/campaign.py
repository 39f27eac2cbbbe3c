"""A run of the proof: seal all answers, analyse, open the answers, judge.

Case folders are numbered; names, seeds and answers are in no file until every case is judged. A run
that was killed can be resumed: it makes the answers again and compares their hashes with those that
were sealed.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rulec_runtime.output.write_file import write_text

from rulec.engines.call import Call, Engine
from rulec.engines.engine import in_order
from rulec.prove.analyst import FORM, analyse, read_form
from rulec.prove.judge import judge
from rulec.prove.partition import Partition, Planned
from rulec.prove.results import Judged
from rulec.prove.run_folder import CASES, SEALS, tool_digest
from rulec.prove.truth.sealed import Case

OPENED = "answer-opened.json"

OnProgress = Callable[[str, int, int], None]
"""Called with the name of the work, the number of finished parts, and that of all parts."""

B = TypeVar("B")


class Changed(Exception):
    """The folder belongs to another run or tool, or an answer is not what was sealed."""


def sealed(partition: Partition, work: Path, engine: Engine, on_progress: OnProgress) -> list[str]:
    """Make all cases; returns their hashes by number, empty if no plant shows the effect.

    Raises Changed if the folder was sealed with other answers.
    """
    if kept := owned(work, partition.digest):
        return kept
    cases = partition.cases()
    todo = [(case, folder_of(work, i)) for i, case in enumerate(cases)]
    made = list(spread(_seal, todo, engine, lambda n: on_progress("sealing", n, len(todo))))
    _write_seals(work, [*_head(partition.digest), *made])
    return made


def owned(work: Path, whose: str) -> list[str]:
    """Claim a folder for a run; returns the hashes that were sealed in it, none at first.

    Raises Changed if the folder belongs to another run, or to this one with another tool.
    """
    head = _head(whose)
    file = work / SEALS
    kept = file.read_text("utf-8", "replace").splitlines() if file.exists() else []
    if not kept:
        _write_seals(work, head)
    elif kept[0] != whose:
        raise Changed(f"--keep: {work} holds another run; name another folder")
    elif kept[: len(head)] != head:
        why = "the tool or its knowledge base has changed since"
        raise Changed(f"--keep: {work}: {why}, and answers of two are no run; name another folder")
    return kept[len(head) :]


def _head(whose: str) -> list[str]:
    return [whose, f"tool {tool_digest()}"]


def _write_seals(work: Path, lines: Sequence[str]) -> None:
    write_text(work / SEALS, "\n".join(lines) + "\n")


def digest_of(seals: Sequence[str]) -> str:
    """Return one hash over all answers."""
    return hashlib.sha256("\n".join(seals).encode()).hexdigest()


def analysed(work: Path, seals: Sequence[str], engine: Engine, on_progress: OnProgress) -> None:
    """Analyse every case that the tool has not analysed yet."""
    asked([folder_of(work, i) for i, seal in enumerate(seals) if seal], engine, on_progress)


def asked(folders: Sequence[Path], engine: Engine, on_progress: OnProgress) -> None:
    """Analyse every folder with a plant and a recording that the tool has not analysed yet."""
    todo = [(f,) for f in folders if not (f / FORM).exists()]
    done, count = len(folders) - len(todo), len(folders)
    on_progress("analysing", done, count)
    for _ in spread(analyse, todo, engine, lambda n: on_progress("analysing", done + n, count)):
        pass


def judged(
    partition: Partition, work: Path, seals: Sequence[str], engine: Engine, on_progress: OnProgress
) -> list[Judged]:
    """Open the answers and score them. Raises Changed if an answer is not what was sealed."""
    todo = [
        (case, folder_of(work, i), seals[i], partition.name)
        for i, case in enumerate(partition.cases())
        if seals[i]
    ]
    return list(spread(_judge, todo, engine, lambda n: on_progress("judging", n, len(todo))))


def folder_of(work: Path, number: int) -> Path:
    """Return the folder of a case."""
    return work / CASES / f"{number:04d}"


def _seal(case: Planned, folder: Path) -> str:
    try:
        made = case.make()
    except ValueError:
        return ""
    folder.mkdir(parents=True, exist_ok=True)
    made.write(folder)
    return made.answer.digest


def opened(case: Planned, folder: Path, seal: str) -> tuple[Case, dict[str, Any]]:
    """Make a case again; returns it with the tool's answer.

    Raises Changed if its sealed answer is not what it was.
    """
    made = case.make()
    if made.answer.digest != seal:
        raise Changed(f"{folder}: the answer of {case.name} is not the one that was sealed")
    return made, read_form(folder / FORM)


def _judge(case: Planned, folder: Path, seal: str, partition: str) -> Judged:
    made, form = opened(case, folder, seal)
    result = judge(made, form, folder, partition)
    write_text(folder / OPENED, made.answer.to_json())
    return result


def spread(
    work: Callable[..., B],
    todo: Sequence[tuple[Any, ...]],
    engine: Engine,
    on_count: Callable[[int], None],
) -> Iterator[B]:
    """Yield results in the order of the list, from processes that share nothing with this one."""
    counted, calls = itertools.count(1), [Call(words) for words in todo]
    yield from in_order(engine, work, calls, done=lambda _: on_count(next(counted)))
