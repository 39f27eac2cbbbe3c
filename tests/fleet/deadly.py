"""Work that kills its process, which imports nothing else before."""

import os
import time


def ends(task: object, ruleset: str) -> None:
    os._exit(1)


def ends_if(deadly: bool) -> str:
    if deadly:
        os._exit(1)
    time.sleep(1.0)
    return "done"
