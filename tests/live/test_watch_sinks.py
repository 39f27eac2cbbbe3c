"""Where a watch tells what it finds, as a process: journal, broker, OPC UA server, page."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partialmethod
from pathlib import Path
from queue import Queue
from typing import Any

import httpx
import pytest
from rulec_runtime.live.journal.outbox import Outbox
from rulec_runtime.live.journal.store import open_journal

from rulec.cli import main
from tests.live.journal.postgres import Postgres
from tests.live.journal.test_device_health import asked, health_of, values
from tests.live.journal.test_mqtt_out import OwnBroker, broker, listening  # noqa: F401
from tests.live.sources.plant_server import free_port
from tests.live.test_watch import LEAKAGE, environment, watching

CLIENT = httpx.Client(verify=False)
LINES = LEAKAGE.read_text(encoding="utf-8").splitlines(keepends=True)


@contextmanager
def watched(rules: Path, log: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A watch of a log that grows, killed at the end if it still lives."""
    process = subprocess.Popen(
        watching(rules, "--source", str(log), *options),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Rows up to a leakage that is there."""
    file = tmp_path / "log.csv"
    file.write_text("".join(LINES[:59]), encoding="utf-8")
    return file


def until(true: Callable[[], Any], seconds: float = 20.0) -> Any:
    ends = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < ends
        time.sleep(0.2)
    return found


def now_at(page: str) -> dict[str, Any] | None:
    try:
        found: dict[str, Any] = CLIENT.get(f"{page}now.json").json()
    except httpx.TransportError:
        return None
    return found


def test_acknowledged_on_the_page_is_in_the_journal_and_there_again(
    rules: Path, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also what `rulec journal` acknowledged while the page is open."""
    where, port = str(tmp_path / "plant.db"), free_port()
    page, options = f"http://127.0.0.1:{port}/", ("--journal", where, "--page", str(port))
    with watched(rules, log, *options):
        until(lambda: (now_at(page) or {}).get("active"))
        text = CLIENT.get(page).text
        form = {
            name: found[1]
            for name in ("seal", "episode")
            if (found := re.search(f'name="{name}" value="([^"]+)"', text))
        }
        posted = CLIENT.post(f"{page}acknowledge", data={**form, "by": "Ann"})
        assert posted.status_code == 303
        with closing(open_journal(where)) as journal:
            (episode,) = until(lambda: journal.acknowledged("abc"))
    assert main(["journal", where]) == 0
    told = capsys.readouterr().out
    assert re.search(r"acknowledged by Ann, page 127\.0\.0\.1, 20\d\d-", " ".join(told.split()))
    log.write_text("".join(LINES[:60]), encoding="utf-8")
    with watched(rules, log, *options):
        now = until(lambda: now_at(page))
        assert [(e["id"], e["acknowledged"]) for e in now["active"]] == [(episode, True)]
        assert [e["episode"]["subject"] for e in now["past"]].count("A.leakage") >= 5
        noted = next(e["episode"]["id"] for e in now["past"] if not e["episode"]["acknowledged"])
        assert main(["journal", where, "--ack", noted, "--by", "Ben"]) == 0
        until(lambda: noted in {e["episode"]["id"] for e in _acknowledged(now_at(page))})


def first(heard: Queue[Any], wanted: Callable[[str, dict[str, Any]], bool]) -> dict[str, Any]:
    """The next message that is wanted."""
    while True:
        topic, data = heard.get(timeout=20)
        if wanted(topic, data):
            found: dict[str, Any] = data
            return found


def _acknowledged(now: dict[str, Any] | None) -> list[dict[str, Any]]:
    return [e for e in (now or {"past": []})["past"] if e["episode"]["acknowledged"]]


def test_broker_and_device_health_say_how_it_is_until_it_is_ended(
    rules: Path,
    log: Path,
    broker: OwnBroker,  # noqa: F811
) -> None:
    """SIGTERM, as a service is ended: the status is unknown then."""
    client, heard = listening(broker.port, "site/#")
    port = free_port()
    options = ("--mqtt", f"mqtt://127.0.0.1:{broker.port}/site/hall", "--device-health", str(port))
    with watched(rules, log, *options) as process:
        began = first(heard, lambda _, data: data.get("what") == "began")
        assert began["episode"]["subject"] == "A.leakage"
        status = first(heard, lambda topic, _: topic == "site/hall/abc/status")
        assert (status["status"], status["active"]) == ("M", 1)
        found = values(asked(f"opc.tcp://127.0.0.1:{port}", health_of))
        assert found == {"abc": 4, "A": 4, "B": 0, "C": 0}
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    last = first(heard, lambda _, data: data.get("status") == "unknown")
    assert last["text"] == "nobody watches"
    client.loop_stop()


def test_database_that_is_gone_loses_nothing_even_if_the_watch_is_killed_meanwhile(
    rules: Path,
    log: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What waits outlives the process; what is left at the end is told, and written next time."""
    # A watch that ends tries for a second, not for as long as a lock may be held.
    monkeypatch.setattr(Outbox, "close", partialmethod(Outbox.close, 1.0))
    waits = tmp_path / "waits"
    waits.mkdir()
    server = Postgres()
    options = ("--journal", server.url, "--waiting", str(waits))
    log.write_text("".join(LINES[:25]), encoding="utf-8")
    try:
        with closing(open_journal(server.url)) as journal:
            with watched(rules, log, *options) as killed:
                until(lambda: journal.last("abc") >= 3)
                server.stop()
                _add(log, 25, 59)
                until(lambda: list(waits.glob("*.waiting.json")))  # whole: it gets its name last
                killed.kill()
            again = ["watch", str(rules), "--source", str(log), "--until-end", *options]
            assert main(again) == 1
            assert "could not be written; what waits stands in" in capsys.readouterr().err
            _add(log, 59, len(LINES))
            server.start()
            assert main(again) == 0
            events = [entry.event for entry in journal.events("abc")]
        assert [e.number for e in events] == list(range(1, len(events) + 1))
        faults = [e for e in events if e.episode.kind == "fault"]
        for what in ("began", "ended"):
            assert [e.episode.since for e in faults if e.what == what] == [11.0, 31.0, 51.0]
        assert list(waits.iterdir()) == []
        server.stop()
        # Where nothing waits nobody knows which events were told.
        assert main([*again[:-1], str(tmp_path)]) == 1
        assert "rulec: postgresql+psycopg://" in capsys.readouterr().err
    finally:
        server.close()


def _add(log: Path, low: int, high: int) -> None:
    with log.open("a", encoding="utf-8") as out:
        out.writelines(LINES[low:high])


def test_mistakes_are_told(rules: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "notes.txt"
    other.write_text("not events\n", encoding="utf-8")
    for options, words in (
        (("--source", str(tmp_path / "none.csv")), "there is no such file"),
        (("--source", "ftp://x"), "is no source"),
        (("--source", "opc.tcp://localhost:1"), "--map"),
        (("--events", str(other)), "no event; name another file"),
        (("--state", str(other)), "no state of a watch"),
        (("--mqtt", "http://x"), "named mqtt://HOST:PORT"),
        (("--mqtt", "mqtt://x/a/#"), "cannot be the beginning"),
        (("--mqtt-ca", "x.pem"), "name the broker with --mqtt"),
        (("--mqtt", "mqtts://x", "--mqtt-ca", "no.pem"), "no.pem: No such file"),
        (("--device-health", "x"), "write PORT or HOST:PORT"),
        (("--device-health", "0.0.0.0:4840"), "beyond this computer it needs a certificate"),
        (("--device-health-certificates", "x"), "needs --device-health"),
        (
            ("--device-health", "4840", "--device-health-certificates", str(tmp_path)),
            "own.der: there is no such file",
        ),
        (("--waiting", "no/such"), "there is no such folder"),
        (("--journal", str(tmp_path / "j"), "--state", "x"), "leave out --state"),
    ):
        assert 1 == main(["watch", str(rules), "--source", str(LEAKAGE), "--until-end", *options])
        told = capsys.readouterr().err
        assert words in told, (options, told)
    assert other.read_text(encoding="utf-8") == "not events\n"
