"""OPC UA against a server on loopback that is killed, changed, odd and wrong."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from asyncua import ua
from asyncua.crypto import cert_gen
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.remarks import SourceRefused

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
    *("CreateSessionRequest", "ActivateSessionRequest", "ReadRequest", "BrowseRequest"),
    *("CreateSubscriptionRequest", "CreateMonitoredItemsRequest", "PublishRequest"),
    "CloseSessionRequest",
}
"""All services that a healthy connection needs; none of them changes anything in the plant."""


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = {"FIRST_RETRY": 0.1, "SILENT": 1.0, "OPENING": 3.0, "REQUEST": 2.0, "CLOSING": 1.0}
    for name, seconds in waits.items():
        monkeypatch.setattr(limits, name, seconds)


@pytest.fixture(scope="module")
def plant() -> Iterator[PlantServer]:
    server = PlantServer()
    yield server
    server.stop()


@dataclass
class Watch:
    """Sources that are opened, each by a map; all are closed in the end."""

    ruleset: Ruleset
    folder: Path
    opened: list[Taken] = field(default_factory=list)

    def of(self, url: str, text: str = MAP) -> Taken:
        path = self.folder / "map.yaml"
        path.write_text(text, encoding="utf-8")
        self.opened.append(Taken(open_source(url, self.ruleset, path)))
        return self.opened[-1]

    def refused(self, url: str, why: str, text: str = MAP) -> None:
        with pytest.raises(SourceRefused, match=why):
            self.of(url, text)


@pytest.fixture
def watch(abc: Ruleset, tmp_path: Path) -> Iterator[Watch]:
    made = Watch(abc, tmp_path)
    yield made
    for one in made.opened:
        one.source.close()


def test_rows_come_and_nothing_is_written(
    plant: PlantServer, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held between changes, by the stamp of the source; what is bad has no reading."""
    seen = record_services(monkeypatch)
    taken = watch.of(plant.url).until(lambda t: len(t.times) >= 4)
    assert set(taken.of("A.dp")) == {1.8e5}
    stamp = datetime.now(UTC)
    plant.write("A.dp", 2.0, stamp=stamp)
    taken.until(lambda t: t.of("A.dp")[-1] == 2e5)
    assert stamp.timestamp() == pytest.approx(taken.times[taken.of("A.dp").index(2e5)], abs=1e-5)
    plant.write("A.dp", 3.0, code=ua.StatusCodes.BadSensorFailure)
    taken.until(lambda t: math.isnan(t.of("A.dp")[-1]))
    plant.write("A.n", 910.0)
    taken.until(lambda t: t.of("A.n")[-1] != t.of("A.n")[0])
    plant.write("A.dp", 1.8)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.8e5).source.close()
    steps = np.diff(taken.times)
    assert (steps > 0).all()
    assert np.median(steps) == pytest.approx(0.1, abs=0.03)
    assert taken.kinds()[0] == "connected"
    assert ("refused", "A.dp has no reading: BadSensorFailure") in taken.reports
    assert seen == READING


def test_a_server_that_is_killed_is_read_again(watch: Watch) -> None:
    """Lost, stale, connected and the gap are told once each time, and rows go on; a plant that is
    off at the start is waited for, and a namespace is followed by its URI."""
    port, text = free_port(), MAP.replace("ns=2", "nsu=urn:plant")
    taken = watch.of(f"opc.tcp://127.0.0.1:{port}", text).take()
    assert taken.kinds() == ["lost"]
    server = PlantServer(port=port)
    taken.until(lambda t: len(t.times) >= 2)
    server.stop()
    taken.until(lambda t: {"lost", "stale"} <= set(t.kinds()[-2:]))
    count, server.namespaces = len(taken.times), ["urn:other", "urn:plant"]
    server.start()
    taken.until(lambda t: len(t.times) > count + 1 and np.isfinite(t.of("A.dp")[-1]))
    taken.source.close()
    server.stop()
    kinds = taken.kinds()
    assert [kinds.count(k) for k in ("lost", "gap", "connected")] == [2, 1, 2], taken.reports
    assert (np.diff(taken.times) > 0).all()
    server.namespaces = ["urn:other"]
    server.start()
    watch.refused(server.url, "no namespace 'urn:plant'; it has .*urn:other", text)
    server.stop()


def test_a_server_that_falls_silent_is_given_up(plant: PlantServer, watch: Watch) -> None:
    """With all sockets left open, as where the way to it swallows all."""
    taken = watch.of(plant.url).until(lambda t: len(t.times) >= 2)
    still = plant.stand_still()
    taken.until(lambda t: {"stale", "lost"} <= set(t.kinds()))
    still.set()
    count = len(taken.times)
    taken.until(lambda t: len(t.times) > count + 1, 15.0)
    still, begun = plant.stand_still(), time.monotonic()
    taken.source.close()
    still.set()
    assert time.monotonic() - begun < limits.CLOSING + 1.5


def test_what_is_not_as_the_map_says_is_refused(plant: PlantServer, watch: Watch) -> None:
    """At once, by the name of the signal, with both units; units that fit are converted."""
    other = PlantServer(units={"A.dp": "mbar", "A.n": "parrots"})
    plant.add("words", "x", ua.VariantType.String, ua.ObjectIds.BaseDataType)
    for url, line, why in (
        (plant.url, "A.dp: ns=2;s=none", r"map.yaml, line 2: A.dp \(ns=2;s=none\): .*BadNodeIdUnk"),
        (plant.url, "A.dp: parrot", "no node id"),
        (plant.url, "A.dp: nsu=urn:other;s=A.dp", "no namespace 'urn:other'; it has .*urn:plant"),
        (plant.url, "A.dp: ns=2;s=text", "holds String; a number is needed"),
        (plant.url, "A.dp: ns=2;s=words", "the node holds String; a number is needed"),
        (plant.url, "A.dp: {node: ns=2;s=A.dp, unit: mbar}", "map says mbar, .* server says bar"),
        (other.url, "A.n: ns=2;s=A.dp", "it is in mbar, but A.n is measured in rpm"),
        (other.url, "A.n: ns=2;s=A.n", "gives its unit as 'parrots', which is not known"),
    ):
        watch.refused(url, why, f"signals:\n  {line}\n")
    text = MAP.replace("unit: rpm", "unit: rpm, scale: 0.5, offset: 100")
    taken = watch.of(other.url, text).until(lambda t: t.times)
    other.stop()
    assert taken.of("A.dp")[0] == pytest.approx(180.0)
    assert taken.of("A.n")[0] == pytest.approx(550 * watch.ruleset.signal_by_id["A.n"].factor)


def test_modules_may_have_servers_of_their_own(plant: PlantServer, watch: Watch) -> None:
    """One row of both; where one is lost, the other is read on. A URI may name a namespace."""
    two = PlantServer(units={})
    text = f"""
interval: 0.1
stale: 0.5
servers:
  A: {{endpoint: "{plant.url}"}}
  B: {{endpoint: "{two.url}"}}
signals: {{A.dp: nsu=urn:plant;s=A.dp, A.n: ns=2;s=A.n, B.dp: ns=2;s=A.dp}}
"""
    taken = watch.of("opcua", text)
    taken.until(lambda t: t.times and np.isfinite([t.of("A.dp")[-1], t.of("B.dp")[-1]]).all())
    two.stop()
    taken.until(lambda t: np.isnan(t.of("B.dp")[-1]))
    assert np.isfinite(taken.of("A.dp")[-1])
    two.start()
    taken.until(lambda t: np.isfinite(t.of("B.dp")[-1])).source.close()
    two.stop()


def test_old_stamps_and_a_wrong_clock_are_not_times_of_rows(
    plant: PlantServer, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A value that has not changed since yesterday is of now. Rows that nobody takes are dropped,
    and that is told."""
    plant.write("A.dp", 1.7, stamp=datetime.now(UTC) - timedelta(days=1))
    taken = watch.of(plant.url).until(lambda t: len(t.times) >= 2)
    plant.write("A.dp", 1.6, stamp=datetime.now(UTC) + timedelta(days=400))
    taken.until(lambda t: 1.6e5 in t.of("A.dp"))
    assert np.abs(np.array(taken.times) - time.time()).max() < 5
    monkeypatch.setattr(limits, "QUEUED_ROWS", 3)
    taken = watch.of(plant.url)
    time.sleep(0.8)
    assert len(taken.take().times) == 3
    assert "gap" in taken.kinds()


def test_what_cannot_be_used_is_told_again(plant: PlantServer, watch: Watch) -> None:
    """With the reason and what to write in the map; the other signal is read on."""
    plant.write("A.dp", 1.8, code=ua.StatusCodes.Uncertain)
    taken = watch.of(plant.url)
    for value, why in (
        ([1.7, 1.9], "Uncertain; write 'uncertain: accept' at the signal to use it"),
        (math.nan, "an array of 2 values; write 'index: 0' at the signal for the first"),
        (1.8, "no number"),  # though its quality is Good
    ):
        expected = ("stale", f"A.dp has had no reading for 1 s: {why}")
        taken.until(lambda t, expected=expected: expected in t.reports)  # type: ignore[misc]
        plant.write("A.dp", value)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.8e5)
    assert math.isnan(taken.of("A.dp")[0])
    assert not any(map(math.isnan, taken.of("A.n")))
    assert [(n.kind, n.signal) for n in taken.notices if n.signal] == [("stale", "A.dp")] * 3
    assert "lost" not in taken.kinds()
    plant.write("A.dp", [1.7, 1.9], code=ua.StatusCodes.UncertainLastUsableValue)
    text = MAP.replace("ns=2;s=A.dp", "{node: ns=2;s=A.dp, uncertain: accept, index: 1}")
    assert watch.of(plant.url, text).until(lambda t: t.times).of("A.dp")[0] == pytest.approx(1.9e5)
    # A number of no declared type is a number.
    plant.add("double", 1.5, ua.VariantType.Double, ua.ObjectIds.BaseDataType)
    taken = watch.of(plant.url, MAP.replace("s=A.dp", "s=double")).until(lambda t: t.times)
    assert taken.of("A.dp")[0] == 1.5e5


def test_a_node_that_was_deleted_and_comes_again(plant: PlantServer, watch: Watch) -> None:
    """Also where the server does not say that it is gone."""
    plant.write("A.dp", 1.8)
    taken = watch.of(plant.url).until(lambda t: t.times)
    plant.delete("A.dp")
    taken.until(lambda t: any("BadNodeIdUnknown" in n.text for n in t.notices if n.signal))
    assert not math.isnan(taken.of("A.n")[-1])
    plant.add("A.dp", 1.6, ua.VariantType.Double, ua.ObjectIds.Double)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.6e5)
    assert "lost" not in taken.kinds()


FILES = "certificate: watch.der, key: watch.pem"
STRICT = f"security: {{policy: Basic256Sha256, {FILES}}}\n"


def test_signed_and_encrypted_to_the_right_server_alone(watch: Watch) -> None:
    """With another server's certificate in the map nothing is read; an open way is not offered."""
    server = PlantServer(certified=watch.folder)
    server.run(certificate(watch.folder, "watch", "urn:watch"))
    right, wrong = (
        STRICT.replace(FILES, f"{FILES}, server_certificate: {name}.der")
        for name in ("plant", "watch")
    )
    taken = watch.of(server.url, right + MAP).until(lambda t: t.times)
    assert "(Basic256Sha256, SignAndEncrypt): 2 signals" in taken.reports[0][1]
    for security in (wrong, ""):
        taken = watch.of(server.url, security + MAP)
        taken.until(lambda t: "lost" in t.kinds()).take(0.3).source.close()
        assert (taken.times, "connected" in taken.kinds()) == ([], False)
    server.stop()


@pytest.mark.parametrize(("old", "whose"), [("plant", "its"), ("watch", "this computer's own")])
def test_a_certificate_out_of_date_is_refused_unless_the_map_accepts_it(
    old: str, whose: str, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    date = datetime.now(UTC)
    for name in ("plant", "watch"):
        at = date - timedelta(days=800) if name == old else date
        then = SimpleNamespace(now=lambda _, at=at: at)
        with monkeypatch.context() as patch:
            patch.setattr(cert_gen, "datetime", SimpleNamespace(datetime=then, timezone=timezone))
            if name == "plant":
                server = PlantServer(certified=watch.folder)
            else:
                server.run(certificate(watch.folder, "watch", "urn:watch"))
    why = f"{whose} certificate is valid from .* only; renew it"
    watch.refused(server.url, why, STRICT + MAP)
    lax = STRICT.replace(FILES, f"{FILES}, expired: accept")
    watch.of(server.url, lax + MAP).until(lambda t: t.times).source.close()
    server.stop()
