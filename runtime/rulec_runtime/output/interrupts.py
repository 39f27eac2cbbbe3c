"""Start processes while the user may press Ctrl-C."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Processes started within this block ignore interrupts; the parent raises one afterwards.

    A process that is interrupted while it starts, or whose parent is, would print a traceback.
    """
    if threading.current_thread() is not threading.main_thread() or os.name != "posix":
        yield
        return
    from multiprocessing import resource_tracker  # only on POSIX systems

    # If it started with the first process, it would lift the mask.
    resource_tracker.ensure_running()
    deferred: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: deferred.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
    if deferred:
        raise KeyboardInterrupt
