"""Maps: what is wrong with one is told with its line and a remedy; secrets stay secret."""

import re
import sys
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources.map import MQTT, OPCUA, Kind, SourceMap, read_map
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.remarks import SourceRefused
from rulec_runtime.live.sources.sparkplug import Sparkplug

from tests.conftest import ROOT, Patch

GOOD = """
endpoint: opc.tcp://10.0.0.5:4840
interval: 0.5
signals:
  A.dp: ns=2;s=A.dp
  A.n: {node: ns=2;i=5, unit: 1/min, scale: 0.1}
"""


def read(tmp_path: Path, ruleset: Ruleset, text: str, kind: Kind = OPCUA) -> SourceMap:
    path = tmp_path / "map.yaml"
    path.write_text(text, encoding="utf-8")
    return read_map(path, kind, ruleset)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("A.dp:", "A.dq:", "map.yaml, line 5: 'A.dq' is no signal of the plant; did you mean"),
        ("1/min", "parrot", "line 6: unknown unit 'parrot'; for A.n write Hz, rpm"),
        ("1/min", "bar", "line 6: it is in bar, but A.n is measured in rpm"),
        ("interval", "intervall", "line 3: unknown key 'intervall'; did you mean 'interval'?"),
        ("0.5", "fast", "line 3: 'interval' needs a number of 0.01 or more"),
        ("opc.tcp://10.0.0.5:4840", "10.0.0.5", "line 2: '10.0.0.5' is no endpoint; write one"),
        ("opc.tcp://", "opc.tcp://me:secret@", "line 2: an endpoint names no user; write 'user:'"),
        ("endpoint", "# endpoint", "line 5: A.dp: it has no server; write 'endpoint:"),
        ("  A.n", "  A.dp: x\n  A.n", "line 6: 'A.dp' stands twice"),
        ("signals", "password: hunter2\nsignals", "line 4: a password does not stand in a map"),
        ("signals", "password: {env: RULEC_NONE}\nsignals", "no variable 'RULEC_NONE'"),
        ("signals", "security: {key: none.pem}\nsignals", "none.pem: there is no such file"),
        ("signals", "security: {policy: Basic256}\nsignals", "'policy' is one of Basic256Sha256"),
        ("{node", "[node", "line 6: this is not YAML"),
        (GOOD, "", "the map is empty"),
        ("signals", "a: &a [*a]\nsignals", "unknown key 'a'"),
        ("signals:", f"signals: {'[' * 1000}", "nested too deep|not YAML"),
        (GOOD, "a: secret", "this is no map"),
    ],
)
def test_a_mistake_is_told_with_its_line(
    old: str, new: str, why: str, tmp_path: Path, abc: Ruleset
) -> None:
    with pytest.raises(SourceRefused, match=why) as refused:
        read(tmp_path, abc, GOOD.replace(old, new))
    assert "hunter2" not in str(refused.value)
    assert "secret" not in str(refused.value)


def test_a_password_travels_encrypted_and_is_never_shown(
    tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLANT_PASSWORD", "hunter2")
    user = "user: watch\npassword: {env: PLANT_PASSWORD}\nsignals"
    with pytest.raises(SourceRefused, match="line 5: a password would travel readable"):
        read(tmp_path, abc, GOOD.replace("signals", user))
    for name in ("c.der", "k.pem"):
        (tmp_path / name).touch()
    safe = "security: {certificate: c.der, key: k.pem}\n" + user
    found = read(tmp_path, abc, GOOD.replace("signals", safe))
    assert found.servers[0].access.password == "hunter2"
    assert "hunter2" not in repr(found)
    (tmp_path / "secret").write_text("hunter2\n")
    broker = "endpoint: mqtts://b\nuser: w\npassword: {file: secret}\nsignals: {A.dp: t/A}\n"
    assert read(tmp_path, abc, broker, MQTT).servers[0].access.password == "hunter2"
    with pytest.raises(SourceRefused, match="without '\\+' and '#'"):
        read(tmp_path, abc, broker.replace("t/A", "t/+"), MQTT)


BLOCK = re.compile(r"^```yaml\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_maps_of_the_page_are_read(tmp_path: Path, abc: Ruleset, monkeypatch: Patch) -> None:
    """Each map that docs/read-recordings.md shows; the part on security joined to one."""
    monkeypatch.setenv("PLANT_PASSWORD", "x")
    for name in ("watch.der", "watch.pem", "plant.der"):
        (tmp_path / name).touch()
    page = (ROOT / "docs" / "read-recordings.md").read_text(encoding="utf-8")
    _, _, connect = page.partition("## Connect a running plant")
    one, several, secured, broker, sparkplug = BLOCK.findall(connect)
    assert len(read(tmp_path, abc, one).channels) == 3
    found = read(tmp_path, abc, GOOD)
    assert [(c.address, c.scale) for c in found.channels] == [
        ("ns=2;s=A.dp", 1.0),
        ("ns=2;i=5", 0.1),
    ]
    assert (found.interval, found.servers[0].endpoint) == (0.5, "opc.tcp://10.0.0.5:4840")
    assert [s.name for s in read(tmp_path, abc, several).servers] == ["A", "B"]
    assert read(tmp_path, abc, one + secured).servers[0].access.policy == "Basic256Sha256"
    assert len(read(tmp_path, abc, broker, MQTT).channels) == 4
    births = Sparkplug(read(tmp_path, abc, sparkplug, MQTT).channels)
    assert births.topics == ["spBv1.0/site/+/edge1/#", "spBv1.0/site/+/edge2/#"]


def test_what_is_no_source_or_needs_a_package_is_told(
    tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    for text in ("http://x", "ws://x", "wss://x"):
        with pytest.raises(SourceRefused, match=f"'{text}' is no source"):
            open_source(text, abc)
    for name in ("asyncua", "paho", "paho.mqtt", "paho.mqtt.client"):
        monkeypatch.setitem(sys.modules, name, None)
    for name in ("opcua", "mqtt"):
        with pytest.raises(SourceRefused, match=rf"pip install 'rulec-runtime\[{name}\]'"):
            open_source(name, abc, tmp_path / "x.yaml")
