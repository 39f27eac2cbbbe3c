"""Read the AutomationML files of a container. Nothing is ever unpacked onto the disk."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.output.open_file import begin_of

from rulec.mtp import limits
from rulec.mtp.refused import MtpRefused


@dataclass(frozen=True)
class Member:
    """One AutomationML file; `label` is its name in messages."""

    label: str
    data: bytes


def read_members(path: Path) -> list[Member]:
    """AutomationML files of a .mtp, .zip or .aml file, sorted by name.

    Raises `MtpRefused` if there is none or the container is damaged or hostile, and OSError if
    the file cannot be read.
    """
    data = begin_of(path, limits.LARGEST_FILE + 1)
    name = path.name
    if len(data) > limits.LARGEST_FILE:
        raise MtpRefused(
            f"{name}: it has more than {limits.LARGEST_FILE >> 20} MB; is it an MTP? Export the "
            "module alone"
        )
    if not data:
        raise MtpRefused(f"{name}: the file is empty; export it again")
    if not data.startswith(b"PK"):
        return [Member(name, data)]
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return list(_members(archive, name))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
        raise MtpRefused(
            f"{name}: the container is damaged ({error}); copy or export it again"
        ) from None


def _members(archive: zipfile.ZipFile, name: str) -> Iterator[Member]:
    entries = archive.infolist()
    if len(entries) > limits.MOST_MEMBERS:
        raise MtpRefused(
            f"{name}: {len(entries)} files in it, more than {limits.MOST_MEMBERS}; is it an MTP?"
        )
    for entry in entries:
        _check_path(entry, name)
    wanted = [e for e in entries if _ends(e, ".aml")]
    wanted = wanted or [e for e in entries if _ends(e, ".xml", ".caex")]
    if len(wanted) > limits.MOST_MANIFESTS:
        raise MtpRefused(
            f"{name}: {len(wanted)} XML files in it, more than {limits.MOST_MANIFESTS}; export one "
            "module alone"
        )
    if not wanted:
        inside = ", ".join(sorted(e.filename for e in entries)[:3]) or "nothing"
        raise MtpRefused(
            f"{name}: no .aml file in it, but {inside}; give the file that the module's maker "
            "exports as MTP"
        )
    left = limits.LARGEST_UNPACKED
    labels = set()
    for entry in sorted(wanted, key=lambda e: e.filename):
        label = f"{name}/{_plain(entry.filename)}"
        if label in labels:
            raise MtpRefused(f"{label}: it stands twice in the container; export it again")
        labels.add(label)
        data = _unpacked(archive, entry, label, left)
        left -= len(data)
        yield Member(label, data)


def _ends(entry: zipfile.ZipInfo, *endings: str) -> bool:
    file = _plain(entry.filename).rpartition("/")[2]
    # macOS adds files that begin with "._" to a container.
    return file.lower().endswith(endings) and not file.startswith("._") and not entry.is_dir()


def _plain(filename: str) -> str:
    return filename.replace("\\", "/")


def _check_path(entry: zipfile.ZipInfo, name: str) -> None:
    """Refuse names that lead out of the container: no honest tool writes them."""
    plain = _plain(entry.filename)
    if plain.startswith("/") or ":" in plain.split("/")[0] or ".." in plain.split("/"):
        raise MtpRefused(
            f"{name}: '{plain}' in it leads out of the container; it may be an attack, ask its "
            "maker for a new export"
        )
    if not plain.isprintable():
        raise MtpRefused(f"{name}: a file name in it holds control characters; export it again")


def _unpacked(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, label: str, left: int) -> bytes:
    """Content of a member within the limits; its header cannot be trusted."""
    if entry.flag_bits & 1:
        raise MtpRefused(f"{label}: it is encrypted; export it without a password")
    most = min(left, limits.LARGEST_RATIO * max(entry.compress_size, 1))
    if entry.file_size <= most:
        with archive.open(entry) as stream:
            data = stream.read(most + 1)
        if len(data) <= most:
            return data
    raise MtpRefused(
        f"{label}: it unpacks to more than {limits.LARGEST_UNPACKED >> 20} MB or "
        f"{limits.LARGEST_RATIO} times its size, as an attack would; export it again"
    )
