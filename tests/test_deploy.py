"""The unit and the container file of docs/deploy: what they start exists and is taken."""

import re
import shlex
import tomllib
from pathlib import Path

from rulec_runtime.commands.frame import Commands

from tests.conftest import ROOT

FOLDER = ROOT / "docs" / "deploy"
UNIT = (FOLDER / "rulec-watch@.service").read_text(encoding="utf-8")
CONTAINER = (FOLDER / "Containerfile").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "watch-a-plant.md").read_text(encoding="utf-8")
PACKAGE = tomllib.loads((ROOT / "runtime" / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]


def accepted(arguments: list[str]) -> None:
    parser = Commands(ROOT / "runtime" / "rulec_runtime" / "commands.toml").parser()
    parser.parse_args(["watch", *arguments])


def test_unit_and_container_start_a_watch() -> None:
    """The unit starts a watch; the container is built from packages alone, and runs as nobody."""
    (line,) = re.findall(r"^ExecStart=(.*)$", UNIT, re.MULTILINE)
    (more,) = re.findall(r"^RULEC_WATCH=(.*)$", PAGE, re.MULTILINE)
    program, command, *rest = shlex.split(line.replace("$RULEC_WATCH", more))
    assert (Path(program).name, command) == ("rulec-runtime", "watch")
    assert "rulec-runtime" in PACKAGE["scripts"]
    accepted(rest)
    copied = re.findall(r"^(?:COPY|ADD) (\S+)", CONTAINER, re.MULTILINE)
    assert copied == ["rulec_runtime-*.whl"]
    for text in (CONTAINER, PAGE):
        for names in re.findall(r"\.whl\)\[([\w,]+)\]", text):
            assert set(names.split(",")) <= set(PACKAGE["optional-dependencies"])
    (entry,) = re.findall(r"^ENTRYPOINT (.*)$", CONTAINER, re.MULTILINE)
    assert '"/opt/rulec/bin/rulec-runtime", "watch"' in entry
    assert re.search(r"^USER [1-9]\d*$", CONTAINER, re.MULTILINE)
    (run,) = re.findall(r"rulec-watch (/etc/rulec/(?:.*\\\n)*.*)$", PAGE, re.MULTILINE)
    accepted(shlex.split(run.replace("\\\n", " ")))
