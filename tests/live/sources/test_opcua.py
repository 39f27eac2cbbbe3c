"""OPC UA against a server on loopback that is killed, changed and wrong."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asyncua import ua
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.refused import SourceRefused

from tests.live.sources.plant_server import PlantServer, certificate, free_port, record_services
from tests.live.sources.taking import Taken

MAP = """
interval: 0.1
stale: 0.6
signals:
  A.dp: ns=2;s=A.dp
  A.n: {node: ns=2;s=A.n, unit: rpm}
"""

READING = {
    "CreateSessionRequest",
    "ActivateSessionRequest",
    "ReadRequest",
    "BrowseRequest",
    "CreateSubscriptionRequest",
    "CreateMonitoredItemsRequest",
    "PublishRequest",
    "CloseSessionRequest",
}
"""All services that a healthy connection needs; none of them changes anything in the plant."""


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "FIRST_RETRY", 0.1)
    monkeypatch.setattr(limits, "SILENT", 1.0)
    monkeypatch.setattr(limits, "OPENING", 3.0)
    monkeypatch.setattr(limits, "REQUEST", 2.0)
    monkeypatch.setattr(limits, "CLOSING", 1.0)


@pytest.fixture(scope="module")
def plant() -> Iterator[PlantServer]:
    server = PlantServer()
    yield server
    server.stop()


def opened(url: str, abc: Ruleset, tmp_path: Path, text: str = MAP) -> Taken:
    path = tmp_path / "map.yaml"
    path.write_text(text, encoding="utf-8")
    return Taken(open_source(url, abc, path))


def test_rows_come_each_interval_and_nothing_is_written(
    plant: PlantServer, abc: Ruleset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held between changes, by the stamp of the source; what is bad has no reading."""
    seen = record_services(monkeypatch)
    taken = opened(plant.url, abc, tmp_path).until(lambda t: len(t.times) >= 4)
    assert set(taken.of("A.dp")) == {1.8e5}
    stamp = datetime.now(UTC)
    plant.write("A.dp", 2.0, stamp=stamp)
    taken.until(lambda t: t.of("A.dp")[-1] == 2e5)
    assert stamp.timestamp() == pytest.approx(taken.times[taken.of("A.dp").index(2e5)], abs=1e-5)
    plant.write("A.dp", 3.0, code=ua.StatusCodes.BadSensorFailure)
    taken.until(lambda t: math.isnan(t.of("A.dp")[-1]))
    plant.write("A.dp", 3.0, code=ua.StatusCodes.UncertainLastUsableValue)
    plant.write("A.n", 910.0)
    taken.until(lambda t: t.of("A.n")[-1] != t.of("A.n")[0])
    plant.write("A.dp", 1.8)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.8e5)
    taken.source.close()
    steps = np.diff(taken.times)
    assert (steps > 0).all()
    assert np.median(steps) == pytest.approx(0.1, abs=0.03)
    assert taken.kinds()[0] == "connected"
    assert ("refused", "A.dp has no reading: BadSensorFailure") in taken.told
    assert seen == READING


def test_a_namespace_may_be_named_by_its_uri(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """Its number may change when a server starts; what the URI leads to is read."""
    text = MAP.replace("ns=2;s=A.dp", "nsu=urn:plant;s=A.dp")
    taken = opened(plant.url, abc, tmp_path, text).until(lambda t: len(t.times) >= 2)
    taken.source.close()
    assert set(taken.of("A.dp")) == {1.8e5}


def test_a_server_that_is_killed_is_read_again(abc: Ruleset, tmp_path: Path) -> None:
    """Lost, stale, connected and the gap are told once each time, and rows go on; a plant that is
    off at the start is waited for."""
    port = free_port()
    taken = opened(f"opc.tcp://127.0.0.1:{port}", abc, tmp_path).take()
    assert taken.kinds() == ["lost"]
    server = PlantServer(port=port)
    taken.until(lambda t: len(t.times) >= 2)
    server.stop()
    taken.until(lambda t: {"lost", "stale"} <= set(t.kinds()[-2:]))
    count = len(taken.times)
    server.start()
    taken.until(lambda t: len(t.times) > count + 1)
    taken.source.close()
    server.stop()
    kinds = taken.kinds()
    assert [kinds.count(k) for k in ("lost", "gap", "connected")] == [2, 1, 2], taken.told
    assert (np.diff(taken.times) > 0).all()


def test_a_server_that_falls_silent_is_given_up(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """A half-open connection: the way to the server swallows all, and the socket stays open."""
    way = Way(plant.port)
    taken = opened(way.url, abc, tmp_path).until(lambda t: len(t.times) >= 2)
    way.swallows = True
    taken.until(lambda t: {"stale", "lost"} <= set(t.kinds()))
    way.swallows = False
    count = len(taken.times)
    taken.until(lambda t: len(t.times) > count + 1, 15.0)
    begun = time.monotonic()
    way.swallows = True
    taken.source.close()
    assert time.monotonic() - begun < limits.CLOSING + 1.5


def test_what_is_not_as_the_map_says_is_refused(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """At once, by the name of the signal, with both units; units that fit are converted."""
    other = PlantServer(units={"A.dp": "mbar", "A.n": "parrots"})
    cases = (
        (plant.url, "A.dp: ns=2;s=none", r"map.yaml, line 2: A.dp \(ns=2;s=none\): .*BadNodeIdUnk"),
        (plant.url, "A.dp: parrot", "no node id"),
        (plant.url, "A.dp: nsu=urn:other;s=A.dp", "no namespace 'urn:other'; it has .*urn:plant"),
        (plant.url, "A.dp: ns=2;s=text", "holds String; a number is needed"),
        (plant.url, "A.dp: {node: ns=2;s=A.dp, unit: mbar}", "map says mbar, .* server says bar"),
        (other.url, "A.n: ns=2;s=A.dp", "A.n is measured in rpm, but this is in mbar"),
        (other.url, "A.n: ns=2;s=A.n", "gives its unit as 'parrots', which is not known"),
    )
    for url, line, why in cases:
        with pytest.raises(SourceRefused, match=why):
            opened(url, abc, tmp_path, f"signals:\n  {line}\n")
    text = MAP.replace("unit: rpm", "unit: rpm, scale: 0.5, offset: 100")
    taken = opened(other.url, abc, tmp_path, text).until(lambda t: t.times)
    taken.source.close()
    other.stop()
    assert taken.of("A.dp")[0] == pytest.approx(180.0)
    assert taken.of("A.n")[0] == pytest.approx(550 * abc.signal_by_id["A.n"].factor)


def test_modules_may_have_servers_of_their_own(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """One row of both; where one is lost, the other is read on."""
    two = PlantServer(units={})
    text = f"""
interval: 0.1
stale: 0.5
servers:
  A: {{endpoint: "{plant.url}"}}
  B: {{endpoint: "{two.url}"}}
signals: {{A.dp: ns=2;s=A.dp, A.n: ns=2;s=A.n, B.dp: ns=2;s=A.dp}}
"""
    taken = opened("opcua", abc, tmp_path, text)
    taken.until(lambda t: t.times and np.isfinite([t.of("A.dp")[-1], t.of("B.dp")[-1]]).all())
    two.stop()
    taken.until(lambda t: np.isnan(t.of("B.dp")[-1]))
    assert np.isfinite(taken.of("A.dp")[-1])
    two.start()
    taken.until(lambda t: np.isfinite(t.of("B.dp")[-1]))
    taken.source.close()
    two.stop()


def test_signed_and_encrypted_to_the_right_server_alone(abc: Ruleset, tmp_path: Path) -> None:
    """With another server's certificate in the map nothing is read; an open way is not offered."""
    server = PlantServer(certified=tmp_path)
    server.run(certificate(tmp_path, "watch", "urn:watch"))
    files = "certificate: watch.der, key: watch.pem, server_certificate"
    right = f"security: {{policy: Basic256Sha256, {files}: plant.der}}\n"
    taken = opened(server.url, abc, tmp_path, right + MAP).until(lambda t: t.times)
    taken.source.close()
    assert "(Basic256Sha256, SignAndEncrypt): 2 signals" in taken.told[0][1]
    for wrong in (right.replace("plant.der", "watch.der"), ""):
        taken = opened(server.url, abc, tmp_path, wrong + MAP)
        taken.until(lambda t: "lost" in t.kinds()).take(0.3)
        taken.source.close()
        assert (taken.times, "connected" in taken.kinds()) == ([], False)
    server.stop()


def test_old_stamps_and_a_wrong_clock_are_not_times_of_rows(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """A value that has not changed since yesterday is of now."""
    plant.write("A.dp", 1.7, stamp=datetime.now(UTC) - timedelta(days=1))
    taken = opened(plant.url, abc, tmp_path).until(lambda t: len(t.times) >= 2)
    plant.write("A.dp", 1.6, stamp=datetime.now(UTC) + timedelta(days=400))
    taken.until(lambda t: 1.6e5 in t.of("A.dp"))
    taken.source.close()
    assert np.abs(np.array(taken.times) - time.time()).max() < 5


def test_what_nobody_takes_is_dropped_and_told(
    plant: PlantServer, abc: Ruleset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "QUEUED_ROWS", 3)
    taken = opened(plant.url, abc, tmp_path)
    time.sleep(1.0)
    taken.take()
    taken.source.close()
    assert len(taken.times) == 3
    assert "gap" in taken.kinds()


class Way:
    """A way to a server that can swallow what passes, with all sockets left open."""

    def __init__(self, port: int) -> None:
        from threading import Thread

        self.swallows = False
        self._port = port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"opc.tcp://127.0.0.1:{self._listening.getsockname()[1]}"
        Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        from threading import Thread

        while True:
            here, _ = self._listening.accept()
            there = socket.create_connection(("127.0.0.1", self._port))
            for a, b in ((here, there), (there, here)):
                Thread(target=self._pass, args=(a, b), daemon=True).start()

    def _pass(self, a: Any, b: Any) -> None:
        try:
            while data := a.recv(65536):
                if not self.swallows:
                    b.sendall(data)
            if not self.swallows:
                b.close()
        except OSError:
            pass
