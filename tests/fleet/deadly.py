"""Work that kills its process, which imports nothing else before."""

import os


def ends(task: object, ruleset: str) -> None:
    os._exit(1)
