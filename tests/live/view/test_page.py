"""The page: what it shows, whom it lets in, and that no text of the plant becomes markup."""

import contextlib
import html.parser
import json
import re
import socket
import time
import unicodedata
from collections.abc import Iterator
from dataclasses import replace

import httpx
import pytest
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view import limits
from rulec_runtime.live.view.html import CSS, POLICY, SCRIPT, key_of
from rulec_runtime.live.view.machine_forms import TYPE, metrics
from rulec_runtime.live.view.page import Page, application, serve
from rulec_runtime.live.view.page_access import Gate, PageRefused, is_loopback
from starlette.testclient import TestClient

from tests.live.view.nows import TEXTS, before, failing, healthy, hostile, leaking

TOKEN = "correct horse battery staple"
BEARER = {"authorization": f"Bearer {TOKEN}"}
PATHS = ("/", "/now", "/now.json", "/metrics", "/acknowledge", "/nothing")


def asked(
    now: Now, token: str | None = None, host: str = "127.0.0.1", name: str = "localhost"
) -> tuple[TestClient, Gate, list[tuple[str, str]]]:
    """A browser before a page that shows a moment, and what it acknowledged."""
    gate, noted = Gate(host, 80, token), list[tuple[str, str]]()
    app = application(lambda: now, gate, lambda *a: noted.append(a))
    return TestClient(app, base_url=f"http://{name}", follow_redirects=False), gate, noted


def text_of(now: Now) -> str:
    return asked(now)[0].get("/").text


def test_page_shows_the_finding_first_and_asks_for_nothing_else() -> None:
    """It allows its own script alone; before any row nothing is claimed."""
    answer = asked(failing())[0].get("/")
    seen = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", answer.text.partition("<body")[2]))
    for part in (
        "connected: opc.tcp://plant.example:4840",
        "last row 2026-09-21 16:14:19 (0 s ago) 58 rows",
        "B.dp is stuck at 1.82294 bar: even its noise is gone, and 2 others",
        "What to do check the bypass valve",
        "Degree 0.600 (95 %: 0.596 to 0.604), share of the pump",
        "Probability 100 % Why estimates",
        "311.1 l/h ±10.4 l/h 29.9 × threshold",
        "Cannot be judged ▼ C cannot detect errors of B.dp: B.dp: stuck",
        "2026-09-21 16:13:39 ended A.leakage 0.200",
    ):
        assert part in seen, part
    assert seen.index("is stuck") < seen.index("pump delivers") < seen.index("Past events")
    assert answer.headers["content-security-policy"] == POLICY
    assert "unsafe" not in POLICY
    assert 1 == answer.text.count("<script") == answer.text.count(f"<script>{SCRIPT}</script>")
    assert f"<style>{CSS}</style>" in answer.text
    assert not re.search(r'\sstyle=|\son\w+=|(src|href)="(?!data:,|#)', answer.text.lower())
    assert not re.search(r"url\(|import", CSS)
    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["x-content-type-options"] == "nosniff"
    blind = text_of(replace(before(), status="ok"))
    assert "Nothing could be judged yet" in blind
    assert "NOT CONNECTED" in blind
    assert "No fault found" not in blind
    assert "No fault found" in text_of(healthy())


SAMPLE = re.compile(
    r'[a-z_]+\{([a-z_]+="([^"\\\n]|\\["\\n])*",?)*\} (-?[0-9.]+(e[+-]?[0-9]+)?|NaN|[+-]?Inf)'
)


def test_forms_for_machines_say_the_same() -> None:
    """JSON, and metrics as OpenMetrics asks for them."""
    client = asked(failing())[0]
    form, answer = client.get("/now.json").json(), client.get("/metrics")
    assert ("F", {"A": "M", "B": "F", "C": "ok"}) == (form["status"], form["modules"])
    assert ["B.dp.stuck", "A.leakage"] == [e["subject"] for e in form["active"][:2]]
    assert "2026-09-21T16:14:11+02:00" == form["active"][1]["since_date"]
    assert "A.leakage" == form["diagnosis"]["findings"][-1]["fault"]
    odd = replace(healthy(), time=float("nan"), calendar=None)
    assert asked(odd)[0].get("/now.json").json()["time"] is None
    assert TYPE == answer.headers["content-type"]
    lines = answer.text.split("\n")
    assert ["# EOF", ""] == lines[-2:]
    samples = [line for line in lines if line and not line.startswith("#")]
    assert all(SAMPLE.fullmatch(line) for line in samples)
    assert len(samples) == len({line.rpartition(" ")[0] for line in samples})
    assert {
        'rulec_plant_status{plant="abc",rulec_plant_status="F"} 1',
        'rulec_module_status{plant="abc",module="C",rulec_module_status="ok"} 1',
        'rulec_module_status{plant="abc",module="A",rulec_module_status="F"} 0',
        'rulec_rows_total{plant="abc"} 58',
        'rulec_connected{plant="abc"} 1',
    } <= set(samples)
    (degree,) = (s for s in samples if s.startswith("rulec_finding_degree{") and "A.leak" in s)
    assert 0.600 == pytest.approx(float(degree.rpartition(" ")[2]), abs=1e-3)
    assert 'rulec_last_row_age_seconds{plant="abc"} 2.5' in metrics(failing(), 2.5)
    assert "rulec_last_row_age_seconds{" not in metrics(before(), None)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "plant.example", ""])
def test_beyond_loopback_nothing_is_served_without_a_good_token(host: str) -> None:
    assert not is_loopback(host)
    for token in (None, "", "short"):
        with pytest.raises(PageRefused):
            serve(failing, host, 0, token, lambda *_: None)
    assert all(map(is_loopback, ("127.0.0.1", "127.8.8.8", "::1", "localhost")))
    assert 401 == asked(failing(), TOKEN)[0].get("/").status_code  # nor here, where there is one


def test_without_the_token_every_path_is_refused() -> None:
    client, gate, noted = asked(failing(), TOKEN, "0.0.0.0", "192.168.1.5")
    for headers in (
        {},
        {"authorization": f"Bearer {TOKEN}x"},
        {"authorization": f"Basic {TOKEN}"},
        {"authorization": "Bearer "},
        {"authorization": "Bearer \xff"},
        {"cookie": f"{gate.cookie}={TOKEN}"},
        {"cookie": f"rulec-81={gate.pass_}"},
        {"cookie": f"{gate.cookie}="},
        {"authorization": "Bearer x", "cookie": f"{gate.cookie}={gate.pass_}"},
    ):
        raw = [(n.encode(), v.encode("latin-1")) for n, v in headers.items()]
        for path in (*PATHS, "/?token=wrong", f"/now.json?token={TOKEN}", f"/?token={TOKEN[:-1]}"):
            for method in ("GET", "POST", "PUT", "HEAD"):
                assert 401 == client.request(method, path, headers=raw).status_code
    assert noted == []


def test_token_opens_and_does_not_stay_in_the_address() -> None:
    """A foreign host sees nothing, not even with the token."""
    client, gate, _ = asked(failing(), TOKEN, "0.0.0.0", "192.168.1.5")
    assert 200 == client.get("/now.json", headers=BEARER).status_code
    answer = client.get("/", params={"token": TOKEN})
    assert (303, "./") == (answer.status_code, answer.headers["location"])
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Lax" in cookie
    assert TOKEN not in cookie
    assert 200 == client.get("/metrics").status_code
    assert gate.pass_ == Gate("0.0.0.0", 80, TOKEN).pass_
    assert gate.seal != Gate("0.0.0.0", 80, TOKEN).seal
    foreign = asked(failing(), TOKEN, name="attacker.example")[0]
    for path in PATHS:
        answer = foreign.get(path, headers=BEARER)
        assert (421, False) == (answer.status_code, "pump" in answer.text)


@pytest.mark.parametrize(
    ("listens", "ours", "hosts"),
    [
        ("127.0.0.1", True, ["localhost:8080", "127.0.0.1", "LOCALHOST."]),
        ("::1", True, ["[::1]:8080"]),
        ("127.0.0.1", False, ["attacker.example", "localhost.attacker.example", ""]),
        ("127.0.0.1", False, ["attacker.example:80", "127.0.0.1.attacker.example"]),
        ("127.0.0.1", False, ["[::1].attacker.example", "[::1]:80.attacker.example"]),
        ("127.0.0.1", False, ["[attacker.example]", "[::1", "127.0.0.1:80:80"]),
        ("0.0.0.0", True, ["10.0.0.7:8080"]),
        ("0.0.0.0", False, ["attacker.example"]),
    ],
)
def test_names_of_other_machines_are_refused(listens: str, ours: bool, hosts: list[str]) -> None:
    """A name that was rebound to this machine is still another's."""
    gate = Gate(listens, 8080, TOKEN)
    for host in hosts:
        assert ours == gate.knows_host([host]), host
        assert not gate.knows_host([host, host])
    assert not gate.knows_host([])


def test_page_acknowledges() -> None:
    """A program has no seal: it has the token, and names the episode by its id."""
    client, gate, noted = asked(failing())
    episode = failing().active[1].id
    form = {"episode": key_of(episode), "seal": gate.seal}
    assert f'value="{key_of(episode)}"' in client.get("/").text
    plain = client.post("/acknowledge", data=form, headers={"origin": "http://localhost"})
    assert (303, "./") == (plain.status_code, plain.headers["location"])
    quiet = client.post("/acknowledge", data=form, headers={"accept": "application/json"})
    assert 204 == quiet.status_code
    assert [(episode, "page testclient")] * 2 == noted
    client, _, noted = asked(failing(), TOKEN)
    client.post("/acknowledge", data={"episode": episode}, headers=BEARER)
    assert [(episode, "page testclient")] == noted


@pytest.mark.parametrize(
    ("changed", "headers", "status"),
    [
        ({}, {"origin": "http://attacker.example"}, 403),
        ({}, {"origin": "null"}, 403),
        ({}, {"origin": "http://["}, 403),
        ({}, {"origin": "http://localhost:81"}, 403),
        ({}, {"sec-fetch-site": "cross-site"}, 403),
        ({}, {"sec-fetch-site": "same-site"}, 403),
        ({"seal": "x"}, {}, 403),
        ({"seal": ""}, {"authorization": "Bearer x"}, 403),
        ({"episode": "x"}, {}, 404),
        ({"episode": "x" * 5000}, {}, 413),
        ({str(i): "x" for i in range(9)}, {}, 413),
    ],
)
def test_forms_of_others_acknowledge_nothing(
    changed: dict[str, str], headers: dict[str, str], status: int
) -> None:
    client, gate, noted = asked(failing())
    form = {"episode": key_of(failing().active[0].id), "seal": gate.seal, **changed}
    assert status == client.post("/acknowledge", data=form, headers=headers).status_code
    assert 405 == client.get("/acknowledge").status_code
    assert noted == []


class Marked(html.parser.HTMLParser):
    """Names of all elements and attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: set[tuple[str, str]] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found |= {(tag, name) for name, _ in attrs} | {(tag, "")}


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_no_text_becomes_markup_a_line_or_a_control_character(text: str) -> None:
    now = hostile(text)
    client, _, _ = asked(now)
    page = client.get("/").text
    known = Marked(text_of(failing())).found | {("span", "class"), ("p", "class")}
    assert Marked(page).found <= known
    body = page.replace(SCRIPT, "").replace(CSS, "")
    odd = {c for c in body if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Cn")}
    assert odd <= {"\n"}
    data = client.get("/now.json").text
    assert all(unicodedata.category(c) not in ("Cc", "Cf") for c in data[:-1])
    assert json.loads(data)["title"] == now.title
    samples = [s for s in client.get("/metrics").text.splitlines() if not s.startswith("#")]
    assert all(SAMPLE.fullmatch(s) for s in samples)
    assert client.get("/now").json()["main"] in page


@pytest.fixture
def served() -> Iterator[Page]:
    """A page that is served."""
    page = serve(leaking, "127.0.0.1", 0, None, lambda *_: None)
    yield page
    page.close()


def port_of(page: Page) -> int:
    return int(page.url.rsplit(":", 1)[1].strip("/"))


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: local"])
def test_connections_that_ask_nothing_shut_nobody_out(
    served: Page, sent: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They give way to whoever asks, and are sent away after some seconds."""
    address = ("127.0.0.1", port_of(served))
    slow = [socket.create_connection(address) for _ in range(150)]
    for one in slow:
        with contextlib.suppress(OSError):
            one.sendall(sent)
    with httpx.Client(headers={"connection": "close"}) as client:
        begun = time.monotonic()
        assert [client.get(served.url).status_code for _ in range(5)] == [200] * 5
    assert time.monotonic() - begun < limits.ASKING
    monkeypatch.setattr(limits, "ASKING", 0.2)
    late = socket.create_connection(address)
    late.settimeout(3.0)
    for piece in b"GET / HT":
        with contextlib.suppress(OSError):  # it is sent away, however busy it is
            late.sendall(bytes([piece]))
        time.sleep(0.05)
    with contextlib.suppress(ConnectionError):
        assert late.recv(1) == b""
    for one in [*slow, late]:
        one.close()


def test_close_sends_everybody_away_and_frees_the_port(served: Page) -> None:
    with socket.create_connection(("127.0.0.1", port_of(served))) as idle:
        with pytest.raises(OSError, match="in use"):
            serve(leaking, "127.0.0.1", port_of(served), None, lambda *_: None)
        since = time.monotonic()
        served.close()
        assert time.monotonic() - since < 3.0
        with contextlib.suppress(ConnectionError):
            assert idle.recv(1) == b""
    serve(leaking, "127.0.0.1", port_of(served), None, lambda *_: None).close()
