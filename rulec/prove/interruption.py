"""Interruption of a run: by a signal, or by the end of the process that started it."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

from rulec.prove.limits import INTERRUPT_AGAIN

INPUT = 0
"""File descriptor of standard input."""


@contextlib.contextmanager
def interruptible(lifeline: bool) -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGINT, on SIGTERM, and when the lifeline ends.

    A signal that is ignored at the start (`nohup`) stays ignored. The `lifeline` is standard input:
    its end means that the process at the other end wants an interrupt, or has ended.
    """
    heard = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) != signal.SIG_IGN]
    if lifeline and signal.SIGTERM not in heard:
        heard.append(signal.SIGTERM)  # the lifeline sends it
    before = {number: signal.signal(number, _interrupt) for number in heard}
    left = threading.Event()
    if lifeline:
        threading.Thread(target=_listen, args=(left,), daemon=True).start()
    try:
        yield
    finally:
        left.set()
        for number, handler in before.items():
            # The lifeline may still be about to send its last signal.
            signal.signal(number, signal.SIG_IGN if lifeline else handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise, unless an interrupt is being handled already."""
    if not isinstance(sys.exc_info()[1], KeyboardInterrupt):
        raise KeyboardInterrupt


def _listen(left: threading.Event) -> None:
    # Not sys.stdin: the interpreter would end while the lock of its buffer is held.
    while os.read(INPUT, 1024):
        pass
    main = threading.main_thread().ident
    # The main thread must get the signal, or it goes on waiting for a result; and more than once,
    # because compiled code (numpy's random numbers) swallows an exception raised below it.
    while main is not None and not left.is_set():
        signal.pthread_kill(main, signal.SIGTERM)
        left.wait(INTERRUPT_AGAIN)
