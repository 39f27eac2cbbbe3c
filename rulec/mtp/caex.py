"""Read CAEX (IEC 62424, versions 2.15 and 3.0) into trees with line numbers; refuse hostile files.

Nothing of a container is ever unpacked onto the disk. Elements go by their local names, since 2.15
has no XML namespace and 3.0 has one. Of the class libraries only the inheritance is kept.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from rulec_runtime.output.open_file import begin_of

from rulec.mtp import limits
from rulec.mtp.package import MtpRefused

_TEXTS = {"Value", "DefaultValue", "Description", "Version", "WriterName", "WriterVendor"}


@dataclass(slots=True)
class Element:
    """An element with its own `content`; `texts` holds that of children that are only text."""

    tag: str
    attributes: dict[str, str]
    place: str
    parent: Element | None
    children: list[Element] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)
    content: str = ""

    def get(self, name: str) -> str:
        return self.attributes.get(name, "").strip()

    def of(self, tag: str) -> Iterator[Element]:
        """Children with a tag."""
        return (child for child in self.children if child.tag == tag)

    def attribute(self, name: str) -> Element | None:
        """Its first attribute with a name."""
        return next((a for a in self.of("Attribute") if a.get("Name") == name), None)

    def text(self, name: str, or_default: bool = False) -> str:
        """Value, or else default value, of an attribute; empty without any."""
        found = self.attribute(name)
        texts = found.texts if found is not None else {}
        return texts.get("Value") or (texts.get("DefaultValue", "") if or_default else "")

    def values(self) -> dict[str, str]:
        """Values of its attributes by lower-case name."""
        return {a.get("Name").lower(): a.texts.get("Value", "") for a in self.of("Attribute")}

    def inside(self) -> Iterator[Element]:
        """Internal elements of `walk`."""
        return (element for element in self.walk() if element.tag == "InternalElement")

    def walk(self) -> Iterator[Element]:
        """This element and all below it, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


def read_caex(label: str, data: bytes, most: int) -> tuple[Element, dict[str, str], int]:
    """Parse one file that has at most `most` elements; `label` is its name in messages.

    Returns its root, the base of each class of its libraries, and how many elements it has. Raises
    `MtpRefused` with the place.
    """
    if not data.strip():
        raise MtpRefused(f"{label}: the file is empty; export it again")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise MtpRefused(f"{label}:{line}: this is not UTF-8; save or export it as UTF-8") from None
    reader = _Reader(label, most)
    try:
        reader.parser.Parse(data, True)
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        raise MtpRefused(
            f"{label}:{error.lineno}: this is not XML ({why}); is the file whole? Export it again"
        ) from None
    except ValueError as error:
        raise MtpRefused(f"{label}: this is not XML ({error}); export it again") from None
    root = reader.root
    if root is None or root.tag != "CAEXFile":
        raise MtpRefused(f"{label}: no 'CAEXFile' in it; give an AutomationML file")
    bases = _bases(root)
    root.children = [child for child in root.children if child.tag in _INSTANCES]
    return root, bases, reader.elements


_INSTANCES = ("InstanceHierarchy", "AdditionalInformation")


def _bases(root: Element) -> dict[str, str]:
    """The base of each class of the libraries by its path; without one, what it stands in."""
    found: dict[str, str] = {}
    waiting = [(library, library.get("Name")) for library in root.of("SystemUnitClassLib")]
    while waiting:
        outer, path = waiting.pop()
        for one in outer.of("SystemUnitClass"):
            name = one.get("Name")
            if len(name) > limits.LONGEST_NAME:
                message = f"the name of a class has {len(name)} characters; is it an MTP?"
                raise MtpRefused(f"{one.place}: {message}")
            found[f"{path}/{name}"] = one.get("RefBaseClassPath") or path
            waiting.append((one, f"{path}/{name}"))
    return found


class _Reader:
    """Handlers of the parser, and what they have built."""

    def __init__(self, label: str, most: int) -> None:
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.EntityDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.root: Element | None = None
        self.elements = 0
        self._label, self._most = label, most
        self._depth = 0
        self._here: Element | None = None

    def _refused(self, text: str) -> MtpRefused:
        return MtpRefused(f"{self._label}:{self.parser.CurrentLineNumber}: {text}")

    def _doctype(self, *_: object) -> None:
        raise self._refused(
            "it declares a document type or entities, which no MTP needs and attacks use; remove "
            "the DOCTYPE"
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self.elements += 1
        if self._depth > limits.DEEPEST:
            raise self._refused(f"elements are nested deeper than {limits.DEEPEST}; is it an MTP?")
        if self.elements > self._most:
            raise self._refused(f"more than {limits.MOST_ELEMENTS} elements; is it an MTP?")
        for key, value in attributes.items():
            if len(value) > limits.LONGEST_TEXT:
                raise self._refused(f"'{key[:40]}' has {len(value)} characters; is it an MTP?")
        place = f"{self._label}:{self.parser.CurrentLineNumber}"
        element = Element(name.rpartition(":")[2], attributes, place, self._here)
        if self._here is None:
            self.root = element
        else:
            self._here.children.append(element)
        self._here = element

    def _end(self, _: str) -> None:
        self._depth -= 1
        ended = self._here
        self._here = None if ended is None else ended.parent
        if ended is not None and ended.tag in _TEXTS and self._here is not None:
            self._here.texts.setdefault(ended.tag, ended.content.strip())
            self._here.children.pop()

    def _text(self, text: str) -> None:
        if self._here is not None and self._here.tag in _TEXTS:
            self._here.content += text
            if len(self._here.content) > limits.LONGEST_TEXT:
                most = f"more than {limits.LONGEST_TEXT} characters"
                raise self._refused(f"a text has {most}; is it an MTP?")


def read_members(path: Path) -> list[tuple[str, bytes]]:
    """AutomationML files of a .mtp, .zip or .aml file, sorted by name: names in messages, content.

    Raises `MtpRefused` if there is none or the container is damaged or hostile, and OSError if
    the file cannot be read.
    """
    data = begin_of(path, limits.LARGEST_FILE + 1)
    name = path.name
    if len(data) > limits.LARGEST_FILE:
        raise MtpRefused(
            f"{name}: it has more than {limits.LARGEST_FILE >> 20} MB; is it an MTP? Export the "
            "module alone"
        )
    if not data:
        raise MtpRefused(f"{name}: the file is empty; export it again")
    if not data.startswith(b"PK"):
        return [(name, data)]
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return list(_members(archive, name))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
        raise MtpRefused(
            f"{name}: the container is damaged ({error}); copy or export it again"
        ) from None


def _members(archive: zipfile.ZipFile, name: str) -> Iterator[tuple[str, bytes]]:
    entries = archive.infolist()
    if len(entries) > limits.MOST_MEMBERS:
        raise MtpRefused(
            f"{name}: {len(entries)} files in it, more than {limits.MOST_MEMBERS}; is it an MTP?"
        )
    for entry in entries:
        _check_path(entry, name)
    wanted = [e for e in entries if _ends(e, ".aml")]
    wanted = wanted or [e for e in entries if _ends(e, ".xml", ".caex")]
    if len(wanted) > limits.MOST_MANIFESTS:
        raise MtpRefused(
            f"{name}: {len(wanted)} XML files in it, more than {limits.MOST_MANIFESTS}; export one "
            "module alone"
        )
    if not wanted:
        inside = ", ".join(sorted(e.filename for e in entries)[:3]) or "nothing"
        raise MtpRefused(
            f"{name}: no .aml file in it, but {inside}; give the file that the module's maker "
            "exports as MTP"
        )
    left = limits.LARGEST_UNPACKED
    labels = set()
    for entry in sorted(wanted, key=lambda e: e.filename):
        label = f"{name}/{_plain(entry.filename)}"
        if label in labels:
            raise MtpRefused(f"{label}: it stands twice in the container; export it again")
        labels.add(label)
        data = _unpacked(archive, entry, label, left)
        left -= len(data)
        yield label, data


def _ends(entry: zipfile.ZipInfo, *endings: str) -> bool:
    file = _plain(entry.filename).rpartition("/")[2]
    # macOS adds files that begin with "._" to a container.
    return file.lower().endswith(endings) and not file.startswith("._") and not entry.is_dir()


def _plain(filename: str) -> str:
    return filename.replace("\\", "/")


def _check_path(entry: zipfile.ZipInfo, name: str) -> None:
    """Refuse names that lead out of the container: no honest tool writes them."""
    plain = _plain(entry.filename)
    if plain.startswith("/") or ":" in plain.split("/")[0] or ".." in plain.split("/"):
        raise MtpRefused(
            f"{name}: '{plain}' in it leads out of the container; it may be an attack, ask its "
            "maker for a new export"
        )
    if not plain.isprintable():
        raise MtpRefused(f"{name}: a file name in it holds control characters; export it again")


def _unpacked(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, label: str, left: int) -> bytes:
    """Content of a member within the limits; its header cannot be trusted."""
    if entry.flag_bits & 1:
        raise MtpRefused(f"{label}: it is encrypted; export it without a password")
    most = min(left, limits.LARGEST_RATIO * max(entry.compress_size, 1))
    if entry.file_size <= most:
        with archive.open(entry) as stream:
            data = stream.read(most + 1)
        if len(data) <= most:
            return data
    raise MtpRefused(
        f"{label}: it unpacks to more than {limits.LARGEST_UNPACKED >> 20} MB or "
        f"{limits.LARGEST_RATIO} times its size, as an attack would; export it again"
    )
