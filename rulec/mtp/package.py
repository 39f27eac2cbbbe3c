"""What a Module Type Package holds, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rulec.mtp.refused import Oddity


@dataclass(frozen=True, kw_only=True)
class Node:
    """A node of an OPC UA server: `id` as a source map has it, `access` as the file has it."""

    id: str
    access: str
    server: str


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """An attribute of a data assembly: a fixed text, or a node with perhaps a default value.

    `text` of a node is what was read there. `dangling` is set where it refers to something that
    the file does not hold.
    """

    text: str
    default: str
    node: Node | None
    dangling: bool
    place: str

    @property
    def known(self) -> str:
        """What is known of the value."""
        return self.text or self.default

    @property
    def is_default(self) -> bool:
        """Whether what is known is a default that the controller may replace."""
        return self.refers and not self.text

    @property
    def refers(self) -> bool:
        return self.node is not None or self.dangling


@dataclass(frozen=True, kw_only=True)
class Tag:
    """A data assembly; `kind` is the last known part of its class path, empty where none is.

    `given` is the name that it has for operators; `name`, that of its element, tells tags apart.
    """

    name: str
    given: str
    title: str
    kind: str
    path: str
    reference: str
    attributes: Mapping[str, Attribute]
    place: str


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter or report value of a service; `tag` is the data assembly behind it."""

    name: str
    kind: str
    tag: Tag | None


@dataclass(frozen=True, kw_only=True)
class Procedure:
    name: str
    number: str
    default: bool
    completes: bool
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True, kw_only=True)
class Service:
    name: str
    procedures: tuple[Procedure, ...]
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True, kw_only=True)
class Symbol:
    """A symbol of a picture: `code` is its ECLASS code, `tag` the data assembly that it shows."""

    name: str
    code: str
    tag: str


@dataclass(frozen=True, kw_only=True)
class Connection:
    """Two symbols that a pipe joins; `linked` where the file says so, else by where they lie."""

    ends: tuple[str, str]
    linked: bool
    pipe: str


@dataclass(frozen=True, kw_only=True)
class Server:
    name: str
    endpoint: str


@dataclass(frozen=True, kw_only=True)
class Package:
    """One module: all tags, servers, services, symbols and connections, and what is odd."""

    file: str
    name: str
    title: str
    version: str
    writer: str
    tags: tuple[Tag, ...]
    servers: tuple[Server, ...]
    services: tuple[Service, ...]
    symbols: tuple[Symbol, ...]
    connections: tuple[Connection, ...]
    odd: tuple[Oddity, ...]
