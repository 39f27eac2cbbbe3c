"""Elements of all files of a container by their ids, and their classes."""

import re
from collections.abc import Iterator, Mapping, Sequence

from rulec_runtime.output.terminal import is_shown

from rulec.mtp import limits
from rulec.mtp.caex import Element
from rulec.mtp.package import MtpRefused
from rulec.mtp.tables import tables

_PATHS = ("RefBaseSystemUnitPath", "RefBaseClassPath", "RefRoleClassPath", "RefBaseRoleClassPath")


class Space:
    """Resolves references, within a file first, then in the other files of its container.

    An id that occurs twice in one file resolves to nothing, so that no link is guessed.
    """

    def __init__(self, roots: Sequence[Element], bases: Mapping[str, str]) -> None:
        self.roots = roots
        self._bases = {_plain(path): _plain(base) for path, base in bases.items()}
        self._by_id: dict[str, dict[str, list[Element]]] = {}
        self._folded: dict[str, set[str]] = {}
        for root in roots:
            here = self._by_id.setdefault(_file(root), {})
            for element in root.walk():
                if key := element.get("ID"):
                    here.setdefault(key, []).append(element)
                    self._folded.setdefault(key.lower(), set()).add(key)

    def find(self, text: str, near: Element) -> Element | None:
        """The element with an id; makers differ in braces and in case."""
        bare = text.strip().strip("{}")
        keys = (text.strip(), bare, *sorted(self._folded.get(bare.lower(), ())))
        own = _file(near)
        for file in (own, *(f for f in self._by_id if f != own)):
            for key in keys:
                if found := self._by_id[file].get(key):
                    return found[0] if len(found) == 1 else None
        return None

    def twice(self) -> Iterator[tuple[str, list[Element]]]:
        """Ids that occur more than once in a file, with their elements."""
        for here in self._by_id.values():
            yield from ((key, found) for key, found in here.items() if len(found) > 1)

    def referring(self, element: Element) -> Iterator[Element]:
        """Attributes inside an element that refer to another file or a part of it."""
        attributes = (one for one in element.walk() if one.tag == "Attribute")
        return (one for one in attributes if one.get("Name").lower() == "refuri")

    def paths(self, element: Element) -> Iterator[str]:
        """Class paths of an element, also by roles, each followed by its base classes."""
        own = [element.get(key) for key in _PATHS]
        roles = [c.get(k) for c in element.children if "Role" in c.tag for k in _PATHS]
        for path in filter(None, (*own, *roles)):
            here, steps = _plain(path), 0
            while here and steps < limits.DEEPEST:
                yield here
                here, steps = self._bases.get(here, ""), steps + 1

    def is_a(self, element: Element, *classes: str) -> bool:
        """Whether one of its paths ends in one of the classes."""
        return any(path.rpartition("/")[2] in classes for path in self.paths(element))

    def is_named(self, element: Element, name: str) -> bool:
        """Whether it is of a class, or has its name and no class path."""
        pathless = not any(element.get(key) for key in _PATHS)
        return (pathless and element.get("Name") == name) or self.is_a(element, name)

    def passes(self, element: Element, part: str) -> bool:
        """Whether one of its paths leads through a class."""
        return any(part in path.split("/") for path in self.paths(element))

    def kind(self, element: Element) -> str:
        """The class of a data assembly: the last part of a path that the tables know."""
        for path in self.paths(element):
            for part in reversed(path.split("/")):
                for name in (part, part.removeprefix("Mon").removeprefix("Lock")):
                    if name in tables().classes:
                        return name
        return ""

    def name(self, element: Element) -> str:
        """Its name on one line. Raises `MtpRefused`, see `checked`."""
        return checked(element.get("Name"), "a name", element.place)


def _file(element: Element) -> str:
    return element.place.rpartition(":")[0]


def _plain(path: str) -> str:
    """A class path without aliases and brackets.

    >>> _plain("Std@[MTPDataObjectSUCLib]/DataAssembly/AnaView")
    'MTPDataObjectSUCLib/DataAssembly/AnaView'
    """
    return re.sub(r"[\[\]]", "", path.rpartition("@")[2]).strip().strip("/")


def checked(text: str, what: str, place: str) -> str:
    """A name on one line. Raises `MtpRefused` if it is too long or would steer a terminal."""
    plain = " ".join(text.split())
    if len(plain) > limits.LONGEST_NAME:
        raise MtpRefused(
            f"{place}: {what} has {len(plain)} characters, more than {limits.LONGEST_NAME}; "
            "shorten it"
        )
    if not plain.isprintable() and not all(map(is_shown, plain)):
        raise MtpRefused(
            f"{place}: {what} holds control characters, as an attack on a terminal would; correct "
            "it in the engineering tool and export again"
        )
    return plain
