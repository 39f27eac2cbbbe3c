"""The folder of a run that `--keep` names: whether it can be used, and by which tool."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path

import rulec_runtime

import rulec
from rulec.knowledge.layers import shipped

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
