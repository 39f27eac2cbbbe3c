"""Units and ranges that a file leaves to the controller, read from a server on loopback."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from asyncua import Server, ua

from rulec.mtp import limits
from tests.live.sources.plant_server import PlantServer, free_port
from tests.mtp.test_import import imported
from tests.mtp.writer import NAMESPACE, Point, manifest

HELD: Mapping[str, Any] = {
    "PI1.VUnit": 1137, "PI1.VSclMin": -1.0, "PI1.VSclMax": 10.0, "PI1.V": 1.8, "FI2.VUnit": 23,
}  # fmt: skip
POINTS = (
    Point(name="PI1", bound=("V", "VUnit", "VSclMin", "VSclMax")),
    Point(name="FI2", bound=("V", "VUnit", "VSclMin")),
)


class Controller(PlantServer):
    """Holds the units and ranges of a module, in a namespace that is not where one might guess."""

    async def _start(self) -> None:
        self._server = server = Server()
        await server.init()
        server.set_endpoint(self.url)
        await server.register_namespace("urn:something-else")
        number = await server.register_namespace(NAMESPACE)
        for name, value in HELD.items():
            await server.nodes.objects.add_variable(
                ua.NodeId(name, number), ua.QualifiedName(name, number), value
            )
        await server.start()


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Server and client share a loaded machine here; an address that nobody has is refused at once
    all the same."""
    monkeypatch.setattr(limits, "ONLINE", 60.0)


@pytest.fixture(scope="module")
def controller() -> Iterator[Controller]:
    server = Controller()
    yield server
    server.stop()


def test_units_and_ranges_are_read_from_the_controller(
    controller: Controller, tmp_path: Path
) -> None:
    """At the address in the file, or another that is given; what is no unit there either is
    told, and what is lacking."""
    module = imported(tmp_path, manifest(POINTS, endpoint=controller.url), "--online")
    pressure, flow = module["signals"]
    assert (pressure["unit"], pressure["range"]) == ("bar", [-1.0, 10.0])
    assert pressure["lacks"] is None
    assert (flow["unit"], flow["unit_as_written"], flow["range"]) == (None, "23", None)
    assert sorted(o["kind"] for o in module["odd"]) == ["unknown units", "values not there"]
    text = (tmp_path / "out" / "modules" / "Dosing.yaml").read_text(encoding="utf-8")
    assert "by default" not in text
    (tmp_path / "other").mkdir()
    module = imported(tmp_path / "other", manifest(POINTS), "--online", controller.url)
    assert module["signals"][0]["unit"] == "bar"


def test_without_the_controller_the_rest_is_imported(tmp_path: Path) -> None:
    """It is told which address does not answer."""
    address = f"opc.tcp://127.0.0.1:{free_port()}"
    module = imported(tmp_path, manifest(POINTS, endpoint=address), "--online")
    (oddity,) = (o for o in module["odd"] if o["kind"] == "servers that do not answer")
    assert oddity["text"].startswith(address)
    assert module["signals"][0]["lacks"] == "the unit: the controller holds it"
