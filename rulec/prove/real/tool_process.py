"""A command of the tool that ends when the process that started it does.

`python -m rulec.prove.real.tool_process mismatch PLANT ...` is `rulec mismatch PLANT ...`, but it
reads its standard input, whose end means that nobody waits for the result any more.
"""

import os
import sys
import threading

from rulec.cli import main

INPUT = 0
"""File descriptor of standard input."""


def _outlived() -> None:
    while os.read(INPUT, 1024):
        pass
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_outlived, daemon=True).start()
    raise SystemExit(main(sys.argv[1:]))
