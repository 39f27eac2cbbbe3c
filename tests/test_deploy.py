"""The unit and the container file of docs/deploy: what they start exists and is taken."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from rulec_runtime.commands.frame import Parser, watch_options

from tests.conftest import ROOT

FOLDER = ROOT / "docs" / "deploy"
UNIT = (FOLDER / "rulec-watch@.service").read_text(encoding="utf-8")
CONTAINER = (FOLDER / "Containerfile").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "watch-a-plant.md").read_text(encoding="utf-8")
PACKAGE = tomllib.loads((ROOT / "runtime" / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]


def accepted(arguments: list[str]) -> None:
    parser = Parser()
    watch_options(parser, "RULESET")
    parser.parse_args(arguments)


def test_the_unit_starts_a_watch() -> None:
    (line,) = re.findall(r"^ExecStart=(.*)$", UNIT, re.MULTILINE)
    (more,) = re.findall(r"^RULEC_WATCH=(.*)$", PAGE, re.MULTILINE)
    program, command, *rest = shlex.split(line.replace("$RULEC_WATCH", more))
    assert (Path(program).name, command) == ("rulec-runtime", "watch")
    assert "rulec-runtime" in PACKAGE["scripts"]
    accepted(rest)


def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze on this machine")
    (program,) = re.findall(r"^ExecStart=(\S+)", UNIT, re.MULTILINE)
    file = tmp_path / "rulec-watch@abc.service"
    file.write_text(UNIT.replace(program, "/bin/true"), encoding="utf-8")
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(file)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_container_is_built_from_packages_alone() -> None:
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
