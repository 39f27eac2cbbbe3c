"""Agents ask, by the SDK's own client in memory; nothing is written, nothing outside is read."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.output.refusal import Refusal

import rulec
from rulec.commands.mcp import Desk, server
from tests.conftest import ROOT

ABC = "abc"
LEAKAGE = "abc/examples/leakage_A.csv"
TOOLS = {"knowledge", "check", "matrix", "diagnose", "explain", "mismatch"}


@pytest.fixture
def plants(tmp_path: Path) -> Path:
    """A folder that holds one plant, with a file beside it that is nobody's business."""
    folder = tmp_path / "served"
    shutil.copytree(ROOT / "plants" / "abc", folder / "abc")
    (tmp_path / "secret.yaml").write_text("plant: secret\n", encoding="utf-8")
    return folder


Ask = Callable[..., Any]


@pytest.fixture
def ask(plants: Path) -> Ask:
    """Calls a tool as an agent does; gives its result, or the tools without a name."""
    pytest.importorskip("mcp", reason="the extra mcp is not installed")
    import anyio
    from mcp import Client

    def asked(name: str | None = None, /, **given: Any) -> Any:
        async def session() -> Any:
            async with Client(server(plants)) as client:
                if name is None:
                    return (await client.list_tools()).tools
                return await client.call_tool(name, given)

        return anyio.run(session)

    return asked


def test_tools_answer(ask: Ask, plants: Path) -> None:
    """Tools are described and only read; a diagnosis is that of the library."""
    tools = ask()
    assert {tool.name for tool in tools} == TOOLS
    assert all(tool.annotations.read_only_hint and len(tool.description) > 60 for tool in tools)
    found = ask("diagnose", plant=ABC, recording=LEAKAGE)
    assert not found.is_error
    own = rulec.diagnose(plants / ABC, plants / LEAKAGE)
    assert own.to_dict()["findings"] == found.structured_content["findings"]
    text = ask("explain", plant=ABC, recording=LEAKAGE).content[0].text
    assert str(own) == text
    assert "leakage" in text
    listed = ask("knowledge", plant=ABC).structured_content
    assert "leakage" in listed["fault"]
    one = ask("knowledge", plant=ABC, name="leakage").structured_content
    assert one["kind"] == "fault"
    assert ask("check", path=ABC).structured_content == {"found": []}
    assert "A.leakage" in ask("matrix", plant=ABC).structured_content["faults"]
    found = ask("mismatch", plant=ABC, recordings=["abc/examples/healthy.csv"]).structured_content
    assert found["verdict"] == "none"
    assert found["story"]


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("check", {"path": "../secret.yaml"}, "leads out of the served folder"),
        ("check", {"path": "/etc/passwd"}, "leads out of the served folder"),
        ("diagnose", {"plant": ABC, "recording": "-"}, "no such file"),
        ("diagnose", {"plant": ABC, "recording": "link.csv"}, "leads out of the served folder"),
        ("matrix", {"plant": "nowhere"}, "no such file or folder"),
        ("knowledge", {"name": "perpetuum"}, "nothing is called 'perpetuum'"),
    ],
)
def test_refusals_reach_the_agent(
    name: str, given: dict[str, str], said: str, ask: Ask, plants: Path
) -> None:
    (plants / "link.csv").symlink_to(plants.parent / "secret.yaml")
    found = ask(name, **given)
    assert found.is_error
    assert said in found.content[0].text
    assert "Traceback" not in found.content[0].text


def test_folders_and_the_extra_are_asked_for(plants: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other folders are named by a variable; what is lacking is said."""
    other = str(ROOT / "plants" / "abc" / "plant.yaml")
    monkeypatch.setenv("RULEC_FILES", str(ROOT / "plants"))
    assert Desk(plants).check(other) == {"found": []}
    monkeypatch.delenv("RULEC_FILES")
    with pytest.raises(Refusal, match="leads out"):
        Desk(plants).check(other)
    monkeypatch.setitem(sys.modules, "mcp", None)
    monkeypatch.setitem(sys.modules, "mcp.server", None)
    with pytest.raises(Refusal, match=r"pip install 'rulec\[mcp\]'"):
        server(plants)


def test_it_ends_with_its_input(plants: Path) -> None:
    """As a process: nothing but messages of the protocol goes to standard output."""
    pytest.importorskip("mcp")
    done = subprocess.run(
        [sys.executable, "-m", "rulec", "mcp", str(plants)],
        stdin=subprocess.DEVNULL, capture_output=True, timeout=60, check=True,
    )  # fmt: skip
    assert done.stdout == b""
