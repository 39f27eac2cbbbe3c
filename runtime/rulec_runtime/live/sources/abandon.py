"""Waiting that ends, whatever is waited for.

A client of asyncua may hang for ever under packet loss, even when it is cancelled (its issues 70,
1072, 1660). So nothing here waits for what was cancelled.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")

_ABANDONED: set[asyncio.Task[Any]] = set()
"""Tasks that were given up; a task that nobody holds may vanish while it runs."""


async def bounded(work: Coroutine[Any, Any, T], seconds: float) -> T:
    """The result of work. Raises TimeoutError, and ConnectionError where it cancelled itself."""
    task = asyncio.ensure_future(work)
    try:
        await asyncio.wait({task}, timeout=seconds)
    finally:
        if not task.done():
            abandon(task)
    if not task.done():
        raise TimeoutError(f"no answer within {seconds:g} s")
    if task.cancelled():
        raise ConnectionError("the connection was closed")
    return task.result()


def abandon(task: asyncio.Task[Any]) -> None:
    """Cancel a task and wait for nothing."""
    _ABANDONED.add(task)
    task.add_done_callback(_ended)
    task._log_destroy_pending = False  # type: ignore[attr-defined] # it may hang to the very end
    task.cancel()


def _ended(task: asyncio.Task[Any]) -> None:
    _ABANDONED.discard(task)
    if not task.cancelled():
        task.exception()  # nobody else asks; else the loop would report it
