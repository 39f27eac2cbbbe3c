"""Parse CAEX (IEC 62424, versions 2.15 and 3.0) into a tree with line numbers; refuse hostile XML.

Elements go by their local names, since 2.15 has no XML namespace and 3.0 has one. Of the class
libraries, which are most of a file, only the inheritance is kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from rulec.mtp import limits
from rulec.mtp.container import Member
from rulec.mtp.refused import MtpRefused

_KEPT = {
    "CAEXFile", "InstanceHierarchy", "InternalElement", "ExternalInterface", "Attribute",
    "InternalLink", "SupportedRoleClass", "RoleRequirements",
    "AdditionalInformation", "WriterHeader",
}  # fmt: skip
_TEXTS = {"Value", "DefaultValue", "Description", "Version", "WriterName", "WriterVendor"}
_CLASS = "SystemUnitClass"


@dataclass(slots=True)
class Element:
    """An element that is kept; `texts` holds the text of children that contain only text."""

    tag: str
    attributes: dict[str, str]
    place: str
    parent: Element | None
    children: list[Element] = field(default_factory=list)
    texts: dict[str, str] = field(default_factory=dict)

    def get(self, name: str) -> str:
        return self.attributes.get(name, "").strip()

    def of(self, tag: str) -> Iterator[Element]:
        """Children with a tag."""
        return (child for child in self.children if child.tag == tag)

    def attribute(self, name: str) -> Element | None:
        """Its first attribute with a name."""
        return next((a for a in self.of("Attribute") if a.get("Name") == name), None)

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


@dataclass(frozen=True)
class Caex:
    """A file: its root, the base of each class of its libraries, and how many elements it keeps."""

    root: Element
    bases: dict[str, str]
    kept: int


def read_caex(member: Member, most: int) -> Caex:
    """Parse one file that keeps at most `most` elements. Raises `MtpRefused` with the place."""
    data, label = member.data, member.label
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
    if reader.root is None:
        raise MtpRefused(f"{label}: no 'CAEXFile' in it; give an AutomationML file")
    return Caex(reader.root, reader.bases, reader.kept)


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
        self.bases: dict[str, str] = {}
        self.kept = 0
        self._label, self._most = label, most
        self._depth = self._elements = 0
        self._skipped = 0
        """Depth below which nothing is kept; 0 where everything is."""
        self._here: Element | None = None
        self._of = ""
        self._parts: list[str] = []
        self._length = 0
        self._classes: list[str] = []

    def _refused(self, text: str) -> MtpRefused:
        return MtpRefused(f"{self._label}:{self.parser.CurrentLineNumber}: {text}")

    def _doctype(self, *_: object) -> None:
        raise self._refused(
            "it declares a document type or entities, which no MTP needs and attacks use; remove "
            "the DOCTYPE"
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._elements += 1
        if self._depth > limits.DEEPEST:
            raise self._refused(f"elements are nested deeper than {limits.DEEPEST}; is it an MTP?")
        if self._elements > limits.MOST_ELEMENTS:
            raise self._refused(f"more than {limits.MOST_ELEMENTS} elements; is it an MTP?")
        tag = name.rpartition(":")[2]
        if self._skipped:
            if tag == _CLASS and self._classes:
                name = attributes.get("Name", "")
                if len(name) > limits.LONGEST_NAME:
                    raise self._refused(
                        f"the name of a class has {len(name)} characters; is it an MTP?"
                    )
                outer = "/".join(self._classes)
                self._classes.append(name)
                self.bases[f"{outer}/{name}"] = attributes.get("RefBaseClassPath", "") or outer
            return
        if tag in _TEXTS:
            self._of, self._parts, self._length = tag, [], 0
        elif tag in _KEPT:
            self._keep(tag, attributes)
        else:
            self._skipped = self._depth
            if tag == "SystemUnitClassLib":
                self._classes = [attributes.get("Name", "")]

    def _keep(self, tag: str, attributes: dict[str, str]) -> None:
        self._of = ""
        self.kept += 1
        if self.kept > self._most:
            raise self._refused(f"more than {limits.MOST_KEPT} elements to keep; is it an MTP?")
        for key, value in attributes.items():
            if len(value) > limits.LONGEST_TEXT:
                raise self._refused(f"'{key[:40]}' has {len(value)} characters; is it an MTP?")
        place = f"{self._label}:{self.parser.CurrentLineNumber}"
        element = Element(tag, attributes, place, self._here)
        if self._here is not None:
            self._here.children.append(element)
        elif tag == "CAEXFile":
            self.root = element
        else:
            raise self._refused(f"the file begins with '{tag}'; an MTP begins with 'CAEXFile'")
        self._here = element

    def _end(self, name: str) -> None:
        self._depth -= 1
        tag = name.rpartition(":")[2]
        if self._skipped:
            if tag == _CLASS and self._classes:
                self._classes.pop()
            if self._depth < self._skipped:
                self._skipped, self._classes = 0, []
        elif tag in _TEXTS:
            if self._here is not None and self._of == tag:
                self._here.texts.setdefault(tag, "".join(self._parts).strip())
            self._of = ""
        elif self._here is not None:
            self._here = self._here.parent

    def _text(self, text: str) -> None:
        if not self._of or self._skipped:
            return
        self._length += len(text)
        if self._length > limits.LONGEST_TEXT:
            raise self._refused(
                f"a text has more than {limits.LONGEST_TEXT} characters; is it an MTP?"
            )
        self._parts.append(text)
