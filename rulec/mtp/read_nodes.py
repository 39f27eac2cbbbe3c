"""Read the list of sources: servers, and nodes by the ids that tags refer to."""

from __future__ import annotations

import re
from base64 import b64decode
from collections.abc import Iterator, Mapping
from uuid import UUID

from rulec.mtp.caex import Element
from rulec.mtp.package import Node, Server
from rulec.mtp.refused import Oddity
from rulec.mtp.space import Space, checked

_ACCESS = {"1": "read", "2": "write", "3": "read and write"}
_WHOLE = re.compile(r"(nsu=[^;]+;|ns=\d+;)?([isgb])=(.+)", re.DOTALL)
_KINDS = {"byte": "i", "short": "i", "int": "i", "long": "i", "integer": "i"} | {
    "id": "g",
    "base64binary": "b",
}
"""Kind of node id by the end of the data type of an identifier: `xs:ID` is a GUID."""


def read_servers(space: Space, package: Element, odd: list[Oddity]) -> Iterator[Server]:
    """Servers of a module with their endpoints; an endpoint is empty if the file gives none."""
    for element in package.inside():
        if element.attribute("Endpoint") is not None or space.is_a(element, "OPCUAServer"):
            endpoint = checked(_value(element, "Endpoint"), "an endpoint", element.place)
            if not endpoint.startswith("opc.tcp://"):
                text = f"server '{space.name(element)}' has the endpoint '{endpoint}'"
                remedy = "write 'endpoint: opc.tcp://HOST:4840' into the map"
                odd.append(Oddity("servers without endpoint", element.place, text, remedy))
                endpoint = ""
            yield Server(name=space.name(element), endpoint=endpoint)


def read_items(space: Space, package: Element, odd: list[Oddity]) -> Mapping[int, Node | None]:
    """The node of each item of a list of sources by the identity of its element; None if the item
    does not identify one."""
    found: dict[int, Node | None] = {}
    for element in package.walk():
        if element.tag in ("ExternalInterface", "InternalElement") and is_item(space, element):
            server = space.name(element.parent) if element.parent is not None else ""
            found[id(element)] = _node(space, element, server, odd)
    return found


def is_item(space: Space, element: Element) -> bool:
    """Whether an element stands for a node."""
    return element.attribute("Identifier") is not None or space.is_a(element, "OPCUAItem")


def _node(space: Space, element: Element, server: str, odd: list[Oddity]) -> Node | None:
    identifier = checked(_value(element, "Identifier"), "an identifier", element.place)
    namespace = checked(_value(element, "Namespace"), "a namespace", element.place)
    try:
        attribute = element.attribute("Identifier")
        data_type = attribute.get("AttributeDataType") if attribute else ""
        found = node_id(identifier, namespace, data_type)
    except ValueError as error:
        text = f"the item '{space.name(element)}' has {error}"
        remedy = "look the node up in the server, and write its id into the map"
        odd.append(Oddity("items without node", element.place, text, remedy))
        return None
    access = _value(element, "Access").strip()
    return Node(id=found, access=_ACCESS.get(access, access.lower()), server=server)


def node_id(identifier: str, namespace: str, data_type: str = "") -> str:
    """A node id as a source map writes it; a namespace is a URI, or a number in older files.

    Raises ValueError that says what is wrong with the identifier.

    >>> node_id("A.dp", "http://maker/pump"), node_id("A.dp", "4"), node_id("ns=3;s=A.dp", "3")
    ('nsu=http://maker/pump;s=A.dp', 'ns=4;s=A.dp', 'ns=3;s=A.dp')
    >>> node_id("17", "4", "xs:unsignedInt"), node_id("i=17", "")
    ('ns=4;i=17', 'i=17')
    >>> node_id("{72962B91-FA75-4AE6-8D28-B404DC7DAF63}", "4", "xs:ID")
    'ns=4;g=72962b91-fa75-4ae6-8d28-b404dc7daf63'
    >>> node_id("M/RbKBsRVkePCePcx24oRA==", "4", "xs:base64Binary")
    'ns=4;b=M/RbKBsRVkePCePcx24oRA=='
    """
    if not identifier:
        raise ValueError("no identifier")
    whole = _WHOLE.fullmatch(identifier)
    if whole:
        own, kind, value = whole.groups()
    else:
        kinds = (kind for end, kind in _KINDS.items() if data_type.lower().endswith(end))
        own, kind, value = None, next(kinds, "s"), identifier
    try:
        value = _valid(kind, value)
    except ValueError:
        what = {"i": "a whole number of 32 bits", "g": "a GUID", "b": "base64"}[kind]
        what_type = f" of type {data_type}" if not whole else ""
        raise ValueError(f"the identifier '{identifier}'{what_type}, which is not {what}") from None
    if own is None and namespace:
        own = f"{'ns' if namespace.isdigit() else 'nsu'}={namespace};"
    return f"{own or ''}{kind}={value}"


def _valid(kind: str, value: str) -> str:
    """The value of a node id in its usual form. Raises ValueError if it does not fit its kind."""
    if kind == "i" and not (value.isdecimal() and int(value) < 1 << 32):
        raise ValueError
    if kind == "g":
        return str(UUID(value))
    if kind == "b":
        value = value.replace(" ", "")
        b64decode(value, validate=True)
    return value


def _value(element: Element, name: str) -> str:
    found = element.attribute(name)
    return (found.texts.get("Value") or found.texts.get("DefaultValue", "")) if found else ""
