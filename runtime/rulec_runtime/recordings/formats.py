"""Find the file of a path, one table of it (FILE#TABLE) or standard input (-), and its reader.

The first bytes and the name of a file tell its format; readers are loaded when needed.
"""

import errno
import functools
import gc
import io
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.output import open_file
from rulec_runtime.output.refusal import to_install
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.arrange import arrange
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_columns
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.titles import is_time, names_of_times

STANDARD_INPUT = Path("-")


def file_and_table(path: Path) -> tuple[Path, str]:
    """File or folder, and the name of a table in it, or an empty one.

    An existing file with # in its name is that file.

    >>> file_and_table(Path("-#slow"))
    (PosixPath('-'), 'slow')
    """
    text = str(path)
    if "#" not in text or path.exists():
        return path, ""
    for at in (i for i, sign in enumerate(text) if sign == "#"):
        file = Path(text[:at])
        if file == STANDARD_INPUT or file.exists():
            return file, text[at + 1 :].replace(os.sep, "/").strip("/")
    return path, ""


def is_there(path: Path) -> bool:
    """Whether a recording exists: a file, a folder, or standard input."""
    file = file_and_table(path)[0]
    return file == STANDARD_INPUT or file.exists()


def opened(path: Path) -> BinaryIO:
    """The bytes of a recording; standard input may be opened repeatedly."""
    file = file_and_table(path)[0]
    if file == STANDARD_INPUT:
        return io.BytesIO(_whole(sys.stdin.buffer))
    try:
        return open_file.opened(file)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        hint = "give - and let it come on standard input"
        raise RecordingRefused(f"{path}: {error.strerror}; {hint}") from None


def bytes_of(path: Path) -> bytes:
    """All bytes of a recording as it is stored."""
    with opened(path) as file:
        return file.read()


@functools.lru_cache(maxsize=1)
def _whole(stream: BinaryIO) -> bytes:
    """All bytes of a stream, cached because it can be read only once."""
    data = stream.read(limits.LARGEST_PIPE + 1)
    if len(data) > limits.LARGEST_PIPE:
        raise RecordingRefused(
            f"-: more than {limits.LARGEST_PIPE >> 20} MB came on standard input; give a file"
        )
    return data


class Reader(Protocol):
    """Tables of an open file; `path` names it in messages, `times` are names of time columns."""

    def __call__(self, file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]: ...


@dataclass(frozen=True)
class Format:
    """A kind of file: `begins` are its identifying bytes with their offsets, `module` holds its
    reader, a function `sheets` (see `Reader`), `extra` brings the packages that it needs."""

    name: str
    suffixes: tuple[str, ...]
    begins: tuple[tuple[int, bytes], ...]
    module: str
    extra: str = ""


_READERS = "rulec_runtime.recordings.readers"
_HDF5 = b"\x89HDF\r\n\x1a\n"

CSV = Format("CSV", (".csv", ".csv.gz"), (), "rulec_runtime.recordings.text_table")

BINARY = (
    Format("Parquet", (".parquet",), ((0, b"PAR1"),), f"{_READERS}.arrow", "parquet"),
    Format("Arrow", (".arrow", ".feather"), ((0, b"ARROW1"),), f"{_READERS}.arrow", "parquet"),
    Format("Excel", (".xlsx", ".xlsm"), ((0, b"PK\x03\x04"),), f"{_READERS}.excel", "excel"),
    Format("MAT 7.3", (), ((0, b"MATLAB 7.3 MAT-file"),), f"{_READERS}.hdf5", "mat"),
    Format("MAT", (".mat",), ((0, b"MATLAB 5.0 MAT-file"),), f"{_READERS}.mat", "mat"),
    Format("MDF", (".mf4", ".mdf", ".dat"), ((0, b"MDF "), (0, b"UnFinMF")), f"{_READERS}.mdf",
           "mdf"),
    Format("LabVIEW measurement", (".lvm",), ((0, b"LabVIEW Measurement"),), f"{_READERS}.lvm"),
    Format("annotated CSV", (),
           tuple((at, mark) for mark in (b"#group,", b"#datatype,", b"#default,") for at in (0, 3)),
           f"{_READERS}.annotated"),
    Format("TDMS", (".tdms",), ((0, b"TDSm"),), f"{_READERS}.tdms", "tdms"),
    Format("HDF5", (".h5", ".hdf5", ".hdf"), tuple((at, _HDF5) for at in (0, 512, 1024, 2048)),
           f"{_READERS}.hdf5", "hdf5"),
)  # fmt: skip
"""The first match counts: a MAT file of version 7.3 is an HDF5 file after its head."""

FORMATS = (CSV, *BINARY)

OTHERS = frozenset(suffix for kind in BINARY for suffix in kind.suffixes)
"""Suffixes of recordings that are read but not written."""

_NO_RECORDING = (
    (b"\xd0\xcf\x11\xe0", "a workbook of an old Excel; save it as .xlsx"),
    (b"\x80\x04", "a pickle of Python, which may run anything when read; save it as Parquet"),
    (b"\x80\x05", "a pickle of Python, which may run anything when read; save it as Parquet"),
    (b"\x93NUMPY", "an array of NumPy without titles; save it as CSV or Parquet"),
)


@contextmanager
def opened_sheet(path: Path, form: FileForm = INFERRED) -> Iterator[Sheet]:
    """The table that a path names, with a column per signal, readable while the context lasts.

    `form` is its description in the column map. Raises `RecordingRefused` if it cannot be read, or
    if several tables are possible.
    """
    with opened_table(path, form) as table:
        sheet = arrange(path, table, form)
        yield replace(sheet, read=lambda raw, numbers, _=form: sheet.read(raw, numbers, form))


@contextmanager
def opened_table(path: Path, form: FileForm) -> Iterator[Sheet]:
    """The same as it is written."""
    source, name = file_and_table(path)
    times = names_of_times(form)
    with opened(path) as file:
        kind = format_of(file, source)
        reader = _reader(kind, source)
        found = _careful(lambda: reader(file, source, times), kind, source)
        for one in found:
            refuse_columns(path, len(one.titles))
        sheet = which(path, found, name, times)
        read, lines = sheet.read, sheet.lines
        yield replace(
            sheet,
            read=lambda raw, numbers, form=form: _careful(
                lambda: read(raw, numbers, form), kind, source
            ),
            lines=partial(_careful, lines, kind, source),
        )


def format_of(file: BinaryIO, path: Path) -> Format:
    """The format of a file by its first bytes; CSV if no other matches."""
    head = file.read(4096)
    file.seek(0)
    if kind := other_than_csv(head):
        return kind
    for mark, text in _NO_RECORDING:
        if head.startswith(mark):
            raise RecordingRefused(f"{path}: this is {text}")
    for kind in BINARY:
        if path.suffix.lower() in kind.suffixes:
            raise RecordingRefused(
                f"{path}: this is no {kind.name} file, though it is called so: it does not begin "
                "like one. Copy it again, or export it anew"
            )
    return CSV


def other_than_csv(head: bytes) -> Format | None:
    """The format of a file with these first bytes, if it is another than CSV."""
    begun = (k for k in BINARY if any(head[at:].startswith(mark) for at, mark in k.begins))
    return next(begun, None)


def is_called_recording(path: Path) -> bool:
    """Whether a file has the suffix of a recording."""
    return any(path.name.lower().endswith(s) for kind in FORMATS for s in kind.suffixes)


def csv_name(path: Path) -> str:
    """Name of the CSV file made from a recording of any format.

    >>> csv_name(Path("run.parquet")), csv_name(Path("run.csv.gz")), csv_name(Path("a.h5#slow"))
    ('run.csv', 'run.csv.gz', 'a.csv')
    """
    file = Path(path.name.partition("#")[0])
    return f"{file.stem}.csv" if file.suffix.lower() in OTHERS else path.name


def _reader(kind: Format, path: Path) -> Reader:
    try:
        reader: Reader = import_module(kind.module).sheets
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "rulec_runtime":
            raise
        raise RecordingRefused(
            f"{path}: to read {kind.name} files, install what they need: {to_install(kind.extra)}"
        ) from None
    return reader


def _careful(read: Callable[[], Any], kind: Format, path: Path) -> Any:
    """Call a function of a reader; whatever its library raises becomes a `RecordingRefused`.

    Libraries raise all kinds of errors for damaged files. Their output on the terminal is
    suppressed.
    """
    if kind is CSV:
        return read()
    with _quiet():
        try:
            return read()
        except RecordingRefused:
            raise
        except MemoryError:
            text = "it needs more memory than this machine has"
        except Exception as error:
            text = (
                f"cannot be read as {kind.name} file ({type(error).__name__}: "
                f"{str(error)[:200]}); is it whole? Copy it again, or export it anew"
            )
            traceback.clear_frames(error.__traceback__)
            gc.collect()  # half-made objects are finalised here, quietly
    raise RecordingRefused(f"{path}: {text}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress warnings and logs of libraries, and errors while they tidy up."""
    before, hook = logging.root.manager.disable, sys.unraisablehook
    logging.disable(logging.CRITICAL)
    sys.unraisablehook = lambda _: None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
        sys.unraisablehook = hook


SHOWN = 8


def which(path: Path, sheets: Sequence[Sheet], name: str, times: Collection[str]) -> Sheet:
    """The table called `name`; if it is empty, the only one with a time column.

    Tables have clocks of their own, which cannot be aligned. Raises `RecordingRefused`.
    """
    if name:
        for sheet in sheets:
            if sheet.name.strip("/") == name:
                return sheet
        raise RecordingRefused(
            f"{path}: there is no table '{name[:40]}' in it{_listed(sheets, times)}"
        )
    timed = [sheet for sheet in sheets if any(is_time(title, times) for title in sheet.titles)]
    if len(timed) == 1:
        return timed[0]
    if timed:
        raise RecordingRefused(
            f"{path}: it holds {len(timed)} tables with times of their own, which are not put on "
            f"one clock; name one, as in '{path.name}#{timed[0].name.strip('/')}'"
            f"{_listed(timed, times)}"
        )
    if len(sheets) == 1:
        return sheets[0]
    raise RecordingRefused(f"{path}: no table in it has a time column{_listed(sheets, times)}")


def _listed(sheets: Sequence[Sheet], times: Collection[str]) -> str:
    """Names of tables and, of those with a time, titles: no more of a foreign file is quoted."""
    shown = []
    for sheet in sheets[:SHOWN]:
        text = f"'{sheet.name.strip('/')}'"
        if any(is_time(title, times) for title in sheet.titles):
            rows = "" if sheet.rows is None else f"{sheet.rows} rows of "
            titles = ", ".join(title.strip() for title in sheet.titles[:3])
            text += f" ({rows}{titles}{', ...' if len(sheet.titles) > 3 else ''})"
        shown.append(text)
    more = f" and {len(sheets) - SHOWN} more" if len(sheets) > SHOWN else ""
    return f": {'; '.join(shown)}{more}" if shown else ""
