"""The folder of a run, which `--keep` names: can it be used, and whose is it?"""

from __future__ import annotations

import tempfile
from pathlib import Path

SEALS, CASES = "seals.txt", "cases"


def unusable(work: Path) -> str | None:
    """What stands in the way, before work is done. What lies there beside a run does not matter.

    The folder is made where it is not there yet; nothing in it is changed.
    """
    try:
        work.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=work).close()
        seals, cases = work / SEALS, work / CASES
        if seals.exists() and not seals.is_file():
            return _refused(seals, "a run has a file there")
        if cases.exists() and not cases.is_dir():
            return _refused(cases, "a run has a folder there")
        if cases.exists() and not seals.exists():
            return _refused(cases, f"no run of rulec prove left it, or there would be a {SEALS}")
        if cases.exists():
            tempfile.TemporaryFile(dir=cases).close()
    except (FileExistsError, NotADirectoryError):
        return _refused(work, "a file is in the way")
    except OSError as error:
        return _refused(work, f"cannot write there ({error.strerror})")
    return None


def _refused(place: Path, why: str) -> str:
    return f"--keep: {place}: {why}; name another folder"
