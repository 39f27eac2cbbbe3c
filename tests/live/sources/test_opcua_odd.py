"""OPC UA servers with odd values, nodes that go, numbers that shift, certificates out of date."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from asyncua import ua
from asyncua.crypto import cert_gen
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.refused import SourceRefused

from tests.live.sources.plant_server import PlantServer, certificate
from tests.live.sources.taking import Taken
from tests.live.sources.test_opcua import MAP, _short, opened  # noqa: F401


@pytest.fixture(scope="module")
def plant() -> Iterator[PlantServer]:
    server = PlantServer()
    yield server
    server.stop()


def lasting(taken: Taken, why: str) -> Taken:
    """Taken until it was told that A.dp lacks, for this reason."""
    text = f"A.dp has had no reading for 1 s: {why}"
    return taken.until(lambda t: any(n.signal == "A.dp" and n.text == text for n in t.notices))


def test_what_cannot_be_used_is_told_again_as_long_as_it_lasts(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """With the reason; the other signal is read on."""
    plant.write("A.dp", 1.8, code=ua.StatusCodes.Uncertain)
    taken = opened(plant.url, abc, tmp_path)
    lasting(taken, "Uncertain; write 'uncertain: accept' at the signal to use it")
    plant.write("A.dp", [1.7, 1.9])
    lasting(taken, "an array of 2 values; write 'index: 0' at the signal for the first")
    plant.write("A.dp", 1.8)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.8e5)
    taken.source.close()
    assert math.isnan(taken.of("A.dp")[0])
    assert not any(map(math.isnan, taken.of("A.n")))
    assert [n.kind for n in taken.notices if n.signal] == ["stale", "stale"]
    assert "lost" not in taken.kinds()


def test_a_map_may_take_uncertain_values_and_one_of_an_array(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    text = MAP.replace("ns=2;s=A.dp", "{node: ns=2;s=A.dp, uncertain: accept, index: 1}")
    plant.write("A.dp", [1.7, 1.9], code=ua.StatusCodes.UncertainLastUsableValue)
    taken = opened(plant.url, abc, tmp_path, text).until(lambda t: t.times)
    taken.source.close()
    assert taken.of("A.dp")[0] == pytest.approx(1.9e5)


def test_a_number_of_no_declared_type_is_a_number(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    base = ua.ObjectIds.BaseDataType
    plant.add("double", 1.5, ua.VariantType.Double, base)
    plant.add("words", "x", ua.VariantType.String, base)
    taken = opened(plant.url, abc, tmp_path, MAP.replace("s=A.dp", "s=double"))
    taken.until(lambda t: t.times).source.close()
    assert taken.of("A.dp")[0] == 1.5e5
    with pytest.raises(SourceRefused, match="the node holds String; a number is needed"):
        opened(plant.url, abc, tmp_path, MAP.replace("s=A.dp", "s=words"))


def test_a_node_that_was_deleted_is_told_and_read_when_it_is_there_again(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """Also where the server does not say that it is gone."""
    plant.write("A.dp", 1.8)
    taken = opened(plant.url, abc, tmp_path).until(lambda t: t.times)
    plant.delete("A.dp")
    taken.until(lambda t: any("BadNodeIdUnknown" in n.text for n in t.notices if n.signal))
    assert not math.isnan(taken.of("A.n")[-1])
    plant.add("A.dp", 1.6, ua.VariantType.Double, ua.ObjectIds.Double)
    taken.until(lambda t: t.of("A.dp")[-1] == 1.6e5)
    taken.source.close()
    assert "lost" not in taken.kinds()


def test_a_namespace_is_followed_by_its_uri_also_by_the_next_watch(
    plant: PlantServer, abc: Ruleset, tmp_path: Path
) -> None:
    """Where the map says ns=2; another namespace in its place is refused."""
    taken = opened(plant.url, abc, tmp_path).until(lambda t: t.times)
    plant.stop()
    taken.until(lambda t: "lost" in t.kinds())
    count, plant.namespaces = len(taken.times), ["urn:other", "urn:plant"]
    plant.start()
    taken.until(lambda t: len(t.times) > count and not math.isnan(t.of("A.dp")[-1]))
    taken.source.close()
    known = taken.source.position  # type: ignore[attr-defined]
    assert known == {"namespaces": {"": {"2": "urn:plant"}}}
    plant.stop()
    plant.namespaces = ["urn:other"]
    plant.start()
    with pytest.raises(SourceRefused, match="no namespace 'urn:plant' any more, which ns=2 was"):
        open_source(plant.url, abc, tmp_path / "map.yaml", known)
    taken = opened(plant.url, abc, tmp_path).until(lambda t: t.times)
    taken.source.close()


@pytest.mark.parametrize("old", ["plant", "watch"])
def test_a_certificate_out_of_date_is_refused_unless_the_map_accepts_it(
    old: str, abc: Ruleset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, years = datetime.datetime.now(datetime.UTC), datetime.timedelta(days=800)
    for name in ("plant", "watch"):
        at = made - years if name == old else made
        then = SimpleNamespace(now=lambda _, at=at: at)
        stub = SimpleNamespace(datetime=then, timezone=datetime.timezone)
        with monkeypatch.context() as patch:
            patch.setattr(cert_gen, "datetime", stub)
            if name == "plant":
                server = PlantServer(certified=tmp_path)
            else:
                server.run(certificate(tmp_path, "watch", "urn:watch"))
    files = "certificate: watch.der, key: watch.pem"
    strict = f"security: {{policy: Basic256Sha256, {files}}}\n"
    whose = "its" if old == "plant" else "this computer's own"
    with pytest.raises(SourceRefused, match=f"{whose} certificate is valid from .* only; renew it"):
        opened(server.url, abc, tmp_path, strict + MAP)
    lax = strict.replace(files, f"{files}, expired: accept")
    taken = opened(server.url, abc, tmp_path, lax + MAP).until(lambda t: t.times)
    taken.source.close()
    server.stop()
