"""The forms of every result: plain data, data frame, display of a notebook, text.

Data frames of pandas, polars and pyarrow, also as input, go through narwhals; a library is loaded
only for its own frames."""

from __future__ import annotations

import argparse
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rulec_runtime.commands.destinations import console, write_json, write_to
from rulec_runtime.output.refusal import Misused, Refusal
from rulec_runtime.output.terminal import as_html, plain, with_styles
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording_file import Cells
from rulec_runtime.recordings.titles import NAMES

if TYPE_CHECKING:
    import narwhals as nw


AnyPath: TypeAlias = "str | PathLike[str]"


class Result(ABC):
    """A result; frozen."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, as `--json` writes it."""

    @abstractmethod
    def tell(self, out: Console) -> None:
        """Print what the command prints."""

    _tables: ClassVar[Mapping[str, Callable[[Any], Columns]]]
    """The method that makes each table, by name; the first is the default."""

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that `to_frame` makes; the first is the default."""
        return tuple(self._tables)

    def to_frame(self, table: str | None = None, *, backend: Backend | None = None) -> Any:
        """One table of the result as a data frame.

        Parameters
        ----------
        table : one of `tables`; by default the first.
        backend : ``pandas``, ``polars`` or ``pyarrow``; by default the first that is installed.

        Raises
        ------
        FrameRefused
            No such library is installed.
        Misused
            There is no such table.
        """
        name = self.tables[0] if table is None else table
        if name not in self._tables:
            raise Misused(f"table '{name}': give one of {', '.join(self._tables)}")
        return frame_of(self._tables[name](self), backend)

    def __str__(self) -> str:
        return plain(self.tell)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield with_styles(self.tell, options.max_width)

    def _repr_html_(self) -> str:
        return as_html(self.tell)


class PageResult(Result):
    """A result that also has a page, for `--report` of its command."""

    @abstractmethod
    def page(self) -> str:
        """The result, one page of HTML."""

    def write_page(self, file: AnyPath) -> None:
        """Write the page."""
        write_text(Path(file), self.page())

    def hand_out(
        self, options: argparse.Namespace, data: Mapping[str, Any] | None = None
    ) -> Console:
        """Write the page and the JSON that a command is asked for, then print; returns the console.

        All files come first: whatever reads the story may go before its end.
        """
        if options.report:
            write_to(options.report, self.page())
        write_json(options, self.to_dict() if data is None else data)
        out = console(options)
        self.tell(out)
        return out


Columns = Mapping[str, Sequence[Any] | np.ndarray]
"""A table by column, each of shape (n,)."""

Backend: TypeAlias = Literal["pandas", "polars", "pyarrow"]

BACKENDS: tuple[Backend, ...] = ("pandas", "polars", "pyarrow")
"""Libraries for frames of results; the first that is installed is the default."""


class FrameRefused(Refusal):
    """No library for data frames is installed, or not the requested one."""


def columns_of(data: Any, name: str) -> tuple[dict[str, Cells], bool]:
    """Columns of a data frame or of a mapping of arrays, and whether their dates are in UTC.

    Parameters
    ----------
    data : frame of pandas, polars or pyarrow, or arrays of shape (n,) by title.
    name : what messages call it.

    Raises
    ------
    RecordingRefused
        It is none of these, or a column holds neither numbers, dates nor words.
    """
    if isinstance(data, Mapping):
        return {str(title): _array(name, str(title), part) for title, part in data.items()}, False
    frame = _frame(data, name)
    zoned = any(getattr(kind, "time_zone", None) for kind in frame.schema.values())
    return {str(title): _cells(name, frame[title]) for title in frame.columns}, zoned


def frame_of(columns: Columns, backend: Backend | None = None) -> Any:
    """Columns as a frame of the requested library, else of the first that is installed.

    Raises `FrameRefused` if it is not installed, or none is.
    """
    import narwhals as nw

    if backend is not None and backend not in BACKENDS:
        raise Misused(f"backend '{backend}': give one of {', '.join(BACKENDS)}")
    installed = [n for n in ([backend] if backend else BACKENDS) if find_spec(n) is not None]
    if not installed:
        wanted = backend or " or ".join(BACKENDS)
        raise FrameRefused(f"a data frame needs {wanted}: pip install {backend or BACKENDS[0]}")
    if installed[0] == "pyarrow":
        columns = {title: list(cells) for title, cells in columns.items()}
    return nw.from_dict(columns, backend=installed[0]).to_native()


def table_of(titles: Sequence[str], rows: Sequence[Sequence[Any]]) -> Columns:
    """Rows as columns.

    >>> table_of(("fault", "degree"), [("A.leakage", 0.2), ("B.leakage", 0.1)])
    {'fault': ['A.leakage', 'B.leakage'], 'degree': [0.2, 0.1]}
    """
    return {title: [row[i] for row in rows] for i, title in enumerate(titles)}


def parts_of(names: Sequence[str], parts: Sequence[Any]) -> Columns:
    """Attributes of objects as columns."""
    return {name: [getattr(part, name) for part in parts] for name in names}


def _frame(data: Any, name: str) -> nw.DataFrame[Any]:
    """A frame of any library for narwhals; an index of times becomes a column."""
    import narwhals as nw

    try:
        found = nw.from_native(data)
    except TypeError:
        raise RecordingRefused(
            f"{name}: {type(data).__name__} is no recording; give a path, a data frame of "
            f"{', '.join(BACKENDS)}, or a mapping of titles to arrays"
        ) from None
    frame = found.collect() if isinstance(found, nw.LazyFrame) else found
    index = nw.maybe_get_index(frame)
    if index is None:
        return frame
    bare = str(index.name).partition("[")[0].strip().lower()
    if bare not in NAMES and np.asarray(index).dtype.kind != "M":
        return frame
    title = str(index.name or NAMES[0])
    return nw.from_native(frame.to_native().assign(**{title: index}), eager_only=True)


def _cells(name: str, series: nw.Series[Any]) -> Cells:
    """A column of a frame as numbers, dates in UTC, durations, or words."""
    import narwhals as nw

    kind = series.dtype
    if kind.is_numeric() or kind == nw.Boolean:
        return np.asarray(series.cast(nw.Float64).to_numpy(), dtype=float)
    if isinstance(kind, nw.Datetime) and kind.time_zone:
        series = series.dt.convert_time_zone("UTC").dt.replace_time_zone(None)
    if kind in (nw.Datetime, nw.Date):
        return np.asarray(series.to_numpy()).astype("datetime64[us]")
    if kind == nw.Duration:
        return np.asarray(series.to_numpy()).astype("timedelta64[us]")
    return _array(name, series.name, series.to_list())


def _array(name: str, title: str, cells: Any) -> Cells:
    """A column as numbers, dates, durations, or words as a file would hold them."""
    array = np.asarray(cells)
    if array.ndim != 1:
        raise RecordingRefused(
            f"{name}: column '{title}' has the shape {array.shape}; give one number per row"
        )
    if array.dtype.kind in "biuf":
        return array.astype(float)
    if array.dtype.kind in "Mm":
        return array
    if array.dtype.kind in "OUTS":
        return ["" if cell is None or cell != cell else str(cell) for cell in array.tolist()]
    raise RecordingRefused(
        f"{name}: column '{title}' holds {array.dtype}, which are neither numbers nor dates"
    )
