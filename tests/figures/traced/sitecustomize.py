"""Notes which files of the project a measurement uses: found by each Python process below it.

A line is written at once, so that processes that are killed, or forked, leave theirs too.
"""

import os
import sys

PACKAGES = ("rulec", "rulec_runtime", "tests")
CODE = ("rulec", "runtime", "tests")
DATA = ("kb", "plants", "tests")
"""Folders whose files count where they are read; code counts where it is imported."""


def _note() -> None:
    goal, root = os.environ["RULEC_TRACED"], os.environ["RULEC_TRACED_ROOT"]
    file = os.open(goal, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    noted: set[str] = set()

    def line(text: str) -> None:
        if text not in noted:
            noted.add(text)
            os.write(file, f"{text}\n".encode())

    def hook(event: str, words: tuple[object, ...]) -> None:
        if event == "import":
            name = str(words[0])
            if name.partition(".")[0] in PACKAGES:
                line(f"import {name}")
        elif event == "open" and isinstance(words[0], str | os.PathLike):
            path = os.path.abspath(os.fspath(words[0]))
            if isinstance(path, str) and path.startswith(root + os.sep):
                inside = path[len(root) + 1 :]
                folder, _, name = inside.rpartition(os.sep)
                top = inside.partition(os.sep)[0]
                if top in CODE and folder.endswith("__pycache__") and name.endswith(".pyc"):
                    # What is imported by importlib, or run: there is no event of import then.
                    line(f"read {os.path.join(os.path.dirname(folder), name.split('.')[0])}.py")
                elif top in DATA and "__pycache__" not in folder and not name.endswith(".py"):
                    line(f"read {inside}")

    sys.addaudithook(hook)


if "RULEC_TRACED" in os.environ:
    _note()
