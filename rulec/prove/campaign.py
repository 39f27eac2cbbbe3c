"""A run of the proof: seal all answers, analyse, open the answers, judge.

Case folders are numbered; names, seeds and answers are in no file until every case is judged. A run
that was killed can be resumed: it makes the answers again and compares their hashes with those that
were sealed. `--keep` names its folder.
"""

import hashlib
import itertools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import rulec_runtime
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.write_file import write_text

import rulec
from rulec.engines.call import Call, Engine
from rulec.engines.engine import in_order
from rulec.knowledge.layers import shipped
from rulec.prove.analyst import FORM, analyse, read_form
from rulec.prove.judge import judge
from rulec.prove.partition import Partition, Planned
from rulec.prove.results import Judged
from rulec.prove.truth.sealed import Case

SEALS, CASES = "seals.txt", "cases"


def tool_digest() -> str:
    """Return a hash of the tool and its knowledge base, so that no run mixes two versions."""
    digest = hashlib.sha256()
    for root in (Path(rulec.__path__[0]), Path(rulec_runtime.__path__[0]), shipped("kb")):
        for file in sorted(f for f in root.rglob("*") if f.suffix in {".py", ".yaml", ".json"}):
            digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()


def unusable(work: Path) -> str | None:
    """Return why the folder cannot be used, before any work is done; None if it can.

    Creates the folder if it does not exist, and changes nothing in it. Other files may be in it.
    """
    seals, cases = work / SEALS, work / CASES
    place, why = work, ""
    try:
        work.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=work).close()
        if seals.exists() and not seals.is_file():
            place, why = seals, "a run has a file there"
        elif cases.exists() and not cases.is_dir():
            place, why = cases, "a run has a folder there"
        elif cases.exists() and not seals.exists():
            place, why = cases, f"no run of rulec prove left it, or there would be a {SEALS}"
        elif cases.exists():
            tempfile.TemporaryFile(dir=cases).close()
    except (FileExistsError, NotADirectoryError):
        why = "a file is in the way"
    except OSError as error:
        why = f"cannot write there ({error.strerror})"
    return f"--keep: {place}: {why}; name another folder" if why else None


OPENED = "answer-opened.json"

OnProgress = Callable[[str, int, int], None]
"""Called with the name of the work, the number of finished parts, and that of all parts."""

B = TypeVar("B")


class Changed(Refusal):
    """The folder belongs to another run or tool, or an answer is not what was sealed."""


@dataclass(frozen=True)
class Workers:
    """Processes that share nothing with this one."""

    engine: Engine
    on_progress: OnProgress

    def each(
        self, what: str, work: Callable[..., B], todo: Sequence[tuple[Any, ...]], done: int = 0
    ) -> list[B]:
        """Return results in the order of the list; `done` parts were finished before."""
        count, finished = done + len(todo), itertools.count(done + 1)
        self.on_progress(what, done, count)
        return in_order(
            self.engine,
            work,
            [Call(words) for words in todo],
            done=lambda _: self.on_progress(what, next(finished), count),
        )


@dataclass(frozen=True)
class Campaign:
    """The cases of a partition in a folder."""

    partition: Partition
    folder: Path
    workers: Workers

    def sealed(self) -> list[str]:
        """Make all cases; returns their hashes by number, empty if no plant shows the effect.

        Raises Changed if the folder was sealed with other answers.
        """
        whose = self.partition.digest
        if kept := owned(self.folder, whose):
            return kept
        todo = [(c, folder_of(self.folder, i)) for i, c in enumerate(self.partition.cases())]
        made = self.workers.each("sealing", _seal, todo)
        write_text(self.folder / SEALS, "\n".join([*_head(whose), *made, ""]))
        return made

    def made(self, seals: Sequence[str]) -> list[tuple[Planned, Path, str]]:
        """Return the cases that were made, with folder and seal."""
        cases = zip(self.partition.cases(), seals, strict=True)
        every = [(case, folder_of(self.folder, i), seal) for i, (case, seal) in enumerate(cases)]
        return [one for one in every if one[-1]]

    def analysed(self, seals: Sequence[str]) -> None:
        """Analyse every case that the tool has not analysed yet."""
        folders = [folder for _, folder, _ in self.made(seals)]
        todo = [(folder,) for folder in folders if not (folder / FORM).exists()]
        self.workers.each("analysing", analyse, todo, len(folders) - len(todo))

    def judged(self, seals: Sequence[str]) -> list[Judged]:
        """Open the answers and score them. Raises Changed if an answer is not what was sealed."""
        return self.workers.each("judging", _judge, self.made(seals))


def owned(work: Path, whose: str) -> list[str]:
    """Claim a folder for a run; returns the hashes that were sealed in it, none at first.

    Raises Changed if the folder belongs to another run, or to this one with another tool.
    """
    head = _head(whose)
    file = work / SEALS
    kept = file.read_text("utf-8", "replace").splitlines() if file.exists() else []
    if not kept:
        write_text(file, "\n".join([*head, ""]))
    elif kept[0] != whose:
        raise Changed(f"--keep: {work} holds another run; name another folder")
    elif kept[: len(head)] != head:
        why = "the tool or its knowledge base has changed since"
        raise Changed(f"--keep: {work}: {why}, and answers of two are no run; name another folder")
    return kept[len(head) :]


def _head(whose: str) -> list[str]:
    return [whose, f"tool {tool_digest()}"]


def digest_of(seals: Sequence[str]) -> str:
    """Return one hash over all answers."""
    return hashlib.sha256("\n".join(seals).encode()).hexdigest()


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


def open_case(case: Planned, folder: Path, seal: str) -> tuple[Case, dict[str, Any]]:
    """Make a case again; returns it with the tool's answer.

    Raises Changed if its sealed answer is not what it was.
    """
    made = case.make()
    if made.answer.digest != seal:
        raise Changed(f"{folder}: the answer of {case.name} is not the one that was sealed")
    return made, read_form(folder / FORM)


def _judge(case: Planned, folder: Path, seal: str) -> Judged:
    made, form = open_case(case, folder, seal)
    result = judge(made.answer, form)
    write_text(folder / OPENED, made.answer.to_json())
    return result
