"""Files that an attacker, or a broken tool, may hand over."""

import contextlib
import io
import random
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.mtp import limits
from rulec.mtp.package import MtpRefused
from rulec.mtp.read_package import read_packages
from tests.conftest import Patch
from tests.mtp.writer import FLOW, PRESSURE, analog, example, manifest

BOMB = (
    '<!DOCTYPE CAEXFile [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">'
    '<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'
)
OUTSIDE = '<!DOCTYPE CAEXFile [<!ENTITY x SYSTEM "file:///etc/passwd">]>'


def packed(members: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return data.getvalue()


def text_of(extra: str = "", head: str = "") -> bytes:
    text = manifest((PRESSURE, FLOW), libraries=extra)
    return text.replace("<CAEXFile ", f"{head}<CAEXFile ", 1).encode()


def nested(levels: int) -> str:
    return '<InternalElement Name="x">' * levels + "</InternalElement>" * levels


def changed(data: bytes, at: int, field: bytes) -> bytes:
    """The same container with another field in both headers of its member."""
    both = bytearray(data)
    for signature, further in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        place = both.find(signature) + at + further
        both[place : place + len(field)] = field
    return bytes(both)


UNPACKED, FLAGS = 22, 6
"""Places of the size and of the flags in a local header."""


CASES = {
    "entity bomb": (text_of(head=BOMB), r"x.aml:2: it declares a document type or entities"),
    "external entity": (text_of(head=OUTSIDE), r"x.aml:2: it declares a document type"),
    "nesting": (text_of(nested(100)), r"x.aml:\d+: elements are nested deeper than 60"),
    "huge attribute": (text_of(f'<InternalElement Name="{"a" * 70_000}"/>'), "70000 characters"),
    "long name": (
        manifest((FLOW,)).replace('"FI12"', f'"{"a" * 400}"').encode(),
        r"x.aml:\d+: a name has 400 characters, more than 300; shorten it",
    ),
    "terminal escape in a name": (
        manifest((FLOW,)).replace('"FI12"', '"\x9b31m"').encode(),
        r"x.aml:\d+: a name holds control characters",
    ),
    "Latin-1": ("<CAEXFile>\nFüllstand</CAEXFile>".encode("latin-1"), "x.aml:2: this is not UTF-8"),
    "one node for two": (
        text_of().replace(b'ID="item-1-V"', b'ID="item-0-V"'),
        r"x.aml:\d+: the id 'item-0-V' stands at .*x.aml:\d+ already, and which node is meant",
    ),
    "another kind of XML": (b"<html></html>", "the file is no CAEX|no 'CAEXFile' in it"),
    "blanks": (b"   \n", "x.aml: the file is empty; export it again"),
    "no tags": (manifest(()).encode(), r"x.aml:\d+: the list of instances is empty"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_hostile_manifest_is_refused(tmp_path: Path, name: str) -> None:
    """Alone and in a container, with its place and a remedy."""
    data, message = CASES[name]
    alone, inside = tmp_path / "x.aml", tmp_path / "x.mtp"
    alone.write_bytes(data)
    inside.write_bytes(packed({"x.aml": data}))
    for file in (alone, inside):
        with pytest.raises(MtpRefused, match=message):
            read_packages(file)


GOOD = text_of()
SMALL, LARGE = packed({"x.aml": GOOD}), packed({"x.aml": bytes(30 << 20)})
CONTAINERS = {
    "zip slip": (packed({"../../x.aml": GOOD}), "'../../x.aml' in it leads out of the container"),
    "escape in a name": (packed({"\x1b[31m.aml": GOOD}), "a file name in it holds control"),
    "bomb": (LARGE, "200 times its size"),
    "forged sizes": (changed(LARGE, UNPACKED, b"\1\0\0\0"), "damaged|200 times its size"),
    "encrypted": (changed(SMALL, FLAGS, b"\1"), "it is encrypted; export it without"),
    "many members": (
        packed({f"{i}.txt": b"" for i in range(limits.MOST_MEMBERS + 1)}, zipfile.ZIP_STORED),
        "2001 files in it",
    ),
    "empty": (b"", "the file is empty; export it again"),
    "cut off": (SMALL[:-30], "the container is damaged"),
}


@pytest.mark.parametrize("name", CONTAINERS)
def test_a_hostile_container_is_refused(tmp_path: Path, name: str) -> None:
    data, message = CONTAINERS[name]
    file = tmp_path / "x.mtp"
    file.write_bytes(data)
    with pytest.raises(MtpRefused, match=message):
        read_packages(file)
    assert [file] == list(tmp_path.iterdir())


def test_a_manifest_in_several_files_is_one_module(tmp_path: Path, monkeypatch: Patch) -> None:
    """With a path of Windows, as some makers write it; files may use the ids of others again.
    What a Mac puts beside them, and XML of the container's own, is left alone. Together members
    keep to the limit, though each is small enough alone."""
    own = b'<CAEXFile><InstanceHierarchy Name="H" ID="tag-0"/></CAEXFile>'
    file = tmp_path / "x.mtp"
    beside = {"__MACOSX/._Manifest.aml": b"\0\xff", "[Content_Types].xml": b"<Types/>"}
    good = b"\xef\xbb\xbf" + GOOD
    file.write_bytes(packed({"Manifest.aml": good, "Source\\Hmi.aml": own, **beside}))
    (package,) = read_packages(file)
    assert [tag.name for tag in package.tags] == ["PI11", "FI12"]
    assert package.odd == ()
    monkeypatch.setattr(limits, "LARGEST_UNPACKED", int(1.5 * len(GOOD)))
    file = tmp_path / "x.mtp"
    file.write_bytes(packed({"a.aml": GOOD, "b.aml": GOOD}))
    with pytest.raises(MtpRefused, match=r"x.mtp/b.aml: it unpacks to more"):
        read_packages(file)


def test_texts_of_a_manifest_are_never_yaml(tmp_path: Path) -> None:
    """Titles, units and names of versions stand in what is written as texts and comments alone."""
    odd = "é\u202e\u2028\x85"
    texts = ('"}: x', "a: b # c", odd, "- [", "'", "{{}}", "*a &b !c", "", "x\ny: z")
    points = [analog(f"PI{i}", text, text or "1137", 0, 5) for i, text in enumerate(texts)]
    text = manifest(points, name="a: [b] # {c}", endpoint="opc.tcp://h:1/'\"}")
    title = "<Description>&lt;x&gt;: [\n signals: {} # \u202e</Description>"
    at = text.index(">", text.index('ID="package"')) + 1
    (tmp_path / "x.aml").write_text(text[:at] + title + text[at:], encoding="utf-8")
    out = tmp_path / "out"
    assert 0 == main(["import", "mtp", str(tmp_path / "x.aml"), "-o", str(out)])
    assert collect([out]) == []
    for file in out.rglob("*.yaml"):
        written = file.read_text(encoding="utf-8")
        assert yaml.safe_load(written)
        assert all(c.isprintable() or c == "\n" for c in written)
    module = yaml.safe_load((out / "modules" / "a-b-c.yaml").read_text(encoding="utf-8"))
    assert module["title"].startswith("<x>: [ signals: {} #")


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(n, marks=pytest.mark.prove) for n in range(1, 20))]
)
def test_changed_bytes_lead_to_messages_alone(tmp_path: Path, seed: int) -> None:
    """A file with some bytes changed, lost or twice is imported or refused, never a crash."""
    rng = random.Random(seed)
    file = tmp_path / "x.aml"
    whole = example().encode()
    for _ in range(100):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 5)):
            at = rng.randrange(len(data))
            if rng.random() < 0.5:
                data[at : at + rng.choice([0, 1, 40])] = rng.choices(b"<>&\"'/= x0\xff\x85", k=1)
            else:
                data[at:at] = data[at : at + rng.choice([1, 9, 300])]
        file.write_bytes(data)
        with contextlib.suppress(MtpRefused):
            read_packages(file)
