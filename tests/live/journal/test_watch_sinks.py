"""Where a watch tells what it finds, as a process: journal, broker, OPC UA server, page."""

import re
import signal
from contextlib import closing
from functools import partialmethod
from pathlib import Path
from typing import Any

import httpx
import pytest
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.store import open_journal

from rulec.cli import main
from tests.live.journal.conftest import Postgres
from tests.live.journal.own_broker import OwnBroker
from tests.live.journal.test_device_health import asked, health_of, values
from tests.live.journal.test_mqtt_out import broker, listening  # noqa: F401
from tests.live.sources.plant_server import free_port
from tests.live.test_watch import LEAKAGE, LINES, add, until, watched

CLIENT = httpx.Client(verify=False)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Rows up to a leakage that is there."""
    add(tmp_path / "log.csv", 0, 59)
    return tmp_path / "log.csv"


def now_at(page: str) -> dict[str, Any]:
    """What a page says; nothing while there is none."""
    try:
        found: dict[str, Any] = CLIENT.get(f"{page}now.json").json()
    except httpx.TransportError:
        return {}
    return found


def test_acknowledged_on_the_page_is_in_the_journal(
    rules: Path, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also what `rulec journal` acknowledged while the page is open."""
    where, port = str(tmp_path / "plant.db"), free_port()
    page, options = f"http://127.0.0.1:{port}/", ("--journal", where, "--page", str(port))
    with watched(rules, "--source", str(log), *options):
        until(lambda: now_at(page).get("active"))
        text = CLIENT.get(page).text
        form = dict(re.findall(r'name="(seal|episode)" value="([^"]+)"', text)[:2])
        posted = CLIENT.post(f"{page}acknowledge", data={**form, "by": "Ann"})
        assert posted.status_code == 303
        with closing(open_journal(where)) as journal:
            (episode,) = until(lambda: journal.acknowledged("abc"))
    assert main(["journal", where]) == 0
    output = " ".join(capsys.readouterr().out.split())
    assert re.search(r"acknowledged by Ann, page 127\.0\.0\.1, 20\d\d-", output)
    add(log, 59, 60)
    with watched(rules, "--source", str(log), *options):
        now = until(lambda: now_at(page))
        assert [(e["id"], e["acknowledged"]) for e in now["active"]] == [(episode, True)]
        past = [e["episode"] for e in now["past"]]
        assert [e["subject"] for e in past].count("A.leakage") >= 5
        noted = next(e["id"] for e in past if not e["acknowledged"])
        assert main(["journal", where, "--ack", noted, "--by", "Ben"]) == 0
        until(
            lambda: (
                noted
                in {
                    e["episode"]["id"] for e in now_at(page)["past"] if e["episode"]["acknowledged"]
                }
            )
        )


def test_broker_and_device_health_say_how_it_is_until_it_is_ended(
    rules: Path,
    log: Path,
    broker: OwnBroker,  # noqa: F811
) -> None:
    """SIGTERM, as a service is ended: the status is unknown then."""
    client, heard = listening(broker.port, "site/#")

    def first(key: str, wanted: str | None = None) -> dict[str, Any]:
        """The next message that says something under a key."""
        while True:
            topic, data = heard.get(timeout=20)
            assert topic.startswith("site/hall/abc/")
            if key in data and wanted in (None, data[key]):
                return data

    port = free_port()
    options = ("--mqtt", f"mqtt://127.0.0.1:{broker.port}/site/hall", "--device-health", str(port))
    with watched(rules, "--source", str(log), *options) as process:
        assert first("what", "began")["episode"]["subject"] == "A.leakage"
        status = first("active")
        assert (status["status"], status["active"]) == ("M", 1)
        found = values(asked(f"opc.tcp://127.0.0.1:{port}", health_of))
        assert found == {"abc": 4, "A": 4, "B": 0, "C": 0}
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    assert first("status", "unknown")["text"] == "nobody watches"
    client.loop_stop()


def test_database_that_is_gone_loses_nothing_even_if_the_watch_is_killed_meanwhile(
    rules: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    server: Postgres,
    schema: str,
) -> None:
    """What waits outlives the process; what is left at the end is told, and written next time."""
    # A watch that ends tries for a second, not for as long as a lock may be held.
    monkeypatch.setattr(Outbox, "close", partialmethod(Outbox.close, 1.0))
    waits, log = tmp_path / "waits", tmp_path / "log.csv"
    waits.mkdir()
    options = ("--journal", schema, "--waiting", str(waits))
    again = ["watch", str(rules), "--source", str(log), "--until-end", *options]
    add(log, 0, 25)
    with closing(open_journal(schema)) as journal:
        with watched(rules, "--source", str(log), *options) as killed:
            until(lambda: journal.last("abc") >= 3)
            with server.gone():
                add(log, 25, 59)
                until(lambda: list(waits.glob("*.waiting.json")))  # whole: it gets its name last
                killed.kill()
                assert main(again) == 1
                assert "could not be written; what waits stands in" in capsys.readouterr().err
        add(log, 59, len(LINES))
        assert main(again) == 0
        events = [entry.event for entry in journal.events()]
    assert [e.number for e in events] == list(range(1, len(events) + 1))
    faults = [e for e in events if e.episode.kind == "fault"]
    for what in ("began", "ended"):
        assert [e.episode.since for e in faults if e.what == what] == [11.0, 31.0, 51.0]
    assert list(waits.iterdir()) == []
    with server.gone():
        # Where nothing waits nobody knows which events were told.
        assert main([*again[:-1], str(tmp_path)]) == 1
    assert "rulec: postgresql+psycopg://" in capsys.readouterr().err


def test_mistakes_are_told(rules: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other, health = tmp_path / "notes.txt", "--device-health"
    other.write_text("not events\n", encoding="utf-8")
    certificates = f"{health}-certificates"
    for options, words in (
        (("--source", str(tmp_path / "none.csv")), "there is no such file"),
        (("--source", "opc.tcp://localhost:1"), "--map"),
        (("--events", str(other)), "no event; name another file"),
        (("--events", "no/such/events.jsonl"), "there is no such folder"),
        (("--state", str(other)), "no state of a watch"),
        (("--mqtt", "mqtt://x/a/#"), "cannot be the beginning"),
        (("--mqtt-ca", "x.pem"), "needs --mqtt URL"),
        (("--mqtt", "mqtts://x", "--mqtt-ca", "no.pem"), "no.pem: No such file"),
        ((health, "x"), "write PORT or HOST:PORT"),
        ((health, "0.0.0.0:4840"), "beyond this computer it needs a certificate"),
        ((certificates, "x"), "needs --device-health"),
        ((health, "4840", certificates, str(tmp_path)), "own.der: there is no such file"),
        (("--waiting", "no/such"), "there is no such folder"),
        (("--journal", str(tmp_path / "j"), "--state", "x"), "leave out --state"),
    ):
        assert 1 == main(["watch", str(rules), "--source", str(LEAKAGE), "--until-end", *options])
        output = capsys.readouterr().err
        assert words in output, (options, output)
    assert other.read_text(encoding="utf-8") == "not events\n"
