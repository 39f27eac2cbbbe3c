"""The forms of every result: plain data, data frame, display of a notebook, text."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from rich.console import Console, ConsoleOptions, RenderResult
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import as_html, plain, with_styles
from rulec_runtime.output.write_file import write_text

from rulec.api.arguments import AnyPath
from rulec.api.frames import Backend, Columns, frame_of


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
    """A result that also has a page."""

    @abstractmethod
    def page(self) -> str:
        """The result, one page of HTML."""

    def write_page(self, file: AnyPath) -> None:
        """Write the page."""
        write_text(Path(file), self.page())
