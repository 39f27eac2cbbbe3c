"""The list of sources: servers, and nodes by the ids that tags refer to."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from rulec.mtp.caex import Element
from rulec.mtp.package import Node, Server
from rulec.mtp.refused import Oddity
from rulec.mtp.space import Space, checked

_ITEMS = ("OPCUAItem",)
_SERVERS = ("OPCUAServer",)
_ACCESS = {"1": "read", "2": "write", "3": "read and write"}
_WHOLE = re.compile(r"(nsu=[^;]+;|ns=\d+;)?[isgb]=.+", re.DOTALL)
_WHOLE_TYPES = ("byte", "short", "int", "long", "integer")
_REMEDY = "look the node up in the server, and write its id into the map"


def read_servers(space: Space, package: Element, odd: list[Oddity]) -> Iterator[Server]:
    """Servers of a module, each with its endpoint, empty where the file says none."""
    for element in package.walk():
        if element.tag == "InternalElement" and _is_server(space, element):
            endpoint = checked(_value(element, "Endpoint"), "an endpoint", element.place)
            if not endpoint.startswith("opc.tcp://"):
                odd.append(
                    Oddity(
                        kind="servers without endpoint",
                        place=element.place,
                        text=f"server '{space.name(element)}' has the endpoint '{endpoint}'",
                        remedy="write 'endpoint: opc.tcp://HOST:4840' into the map",
                    )
                )
                endpoint = ""
            yield Server(name=space.name(element), endpoint=endpoint)


def _is_server(space: Space, element: Element) -> bool:
    return _attribute(element, "Endpoint") is not None or space.is_a(element, _SERVERS)


def read_items(space: Space, package: Element, odd: list[Oddity]) -> Mapping[int, Node | None]:
    """The node of each item of a list of sources, by the identity of its element.

    None where the item says too little.
    """
    found: dict[int, Node | None] = {}
    for element in package.walk():
        if element.tag in ("ExternalInterface", "InternalElement") and is_item(space, element):
            server = space.name(element.parent) if element.parent is not None else ""
            found[id(element)] = _node(space, element, server, odd)
    return found


def is_item(space: Space, element: Element) -> bool:
    named = {a.get("Name") for a in element.of("Attribute")}
    return "Identifier" in named or space.is_a(element, _ITEMS)


def _node(space: Space, element: Element, server: str, odd: list[Oddity]) -> Node | None:
    identifier = checked(_value(element, "Identifier"), "an identifier", element.place)
    namespace = checked(_value(element, "Namespace"), "a namespace", element.place)
    name = space.name(element)
    if not identifier:
        text = f"the item '{name}' has no identifier"
        odd.append(
            Oddity(kind="items without node", place=element.place, text=text, remedy=_REMEDY)
        )
        return None
    access = _value(element, "Access").strip()
    return Node(
        id=node_id(identifier, namespace, _type(element, "Identifier")),
        access=_ACCESS.get(access, access.lower()),
        server=server,
    )


def node_id(identifier: str, namespace: str, data_type: str = "") -> str:
    """A node id as a source map has it; a namespace is a URI, or a number in older files.

    >>> node_id("A.dp", "http://maker/pump"), node_id("A.dp", "4"), node_id("ns=3;s=A.dp", "3")
    ('nsu=http://maker/pump;s=A.dp', 'ns=4;s=A.dp', 'ns=3;s=A.dp')
    >>> node_id("17", "4", "xs:unsignedInt"), node_id("i=17", "")
    ('ns=4;i=17', 'i=17')
    """
    if _WHOLE.fullmatch(identifier) and identifier.startswith("ns"):
        return identifier
    if not _WHOLE.fullmatch(identifier):
        counted = data_type.lower().endswith(_WHOLE_TYPES) and identifier.isdigit()
        identifier = f"{'i' if counted else 's'}={identifier}"
    if not namespace:
        return identifier
    return f"{'ns' if namespace.isdigit() else 'nsu'}={namespace};{identifier}"


def _attribute(element: Element, name: str) -> Element | None:
    return next((a for a in element.of("Attribute") if a.get("Name") == name), None)


def _value(element: Element, name: str) -> str:
    found = _attribute(element, name)
    return (found.texts.get("Value") or found.texts.get("DefaultValue", "")) if found else ""


def _type(element: Element, name: str) -> str:
    found = _attribute(element, name)
    return found.get("AttributeDataType") if found else ""
