"""What a Module Type Package holds, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rulec_runtime.output.refusal import Refusal


@dataclass(frozen=True, kw_only=True)
class Node:
    """A node of an OPC UA server: `id` as a source map writes it, `access` as the file does."""

    id: str
    access: str
    server: str


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """An attribute of a data assembly: a fixed text, or a node that may have a default value.

    `text` of a node is the value read from it. `dangling`: it refers to what the file lacks.
    """

    text: str
    default: str
    node: Node | None
    dangling: bool
    place: str

    @property
    def value(self) -> str:
        """The best known value."""
        return self.text or self.default

    @property
    def is_default(self) -> bool:
        """Whether the known value is a default that the controller may replace."""
        return self.refers and not self.text

    @property
    def refers(self) -> bool:
        """Whether it refers to a node, even to a missing one."""
        return self.node is not None or self.dangling


@dataclass(frozen=True, kw_only=True)
class Tag:
    """A data assembly; `kind` is the last known part of its class path, or empty.

    `given` is the name that operators see; `name`, the name of the element, is unique.
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
class Server:
    name: str
    endpoint: str


@dataclass(frozen=True, kw_only=True)
class Package:
    """One module.

    `services` and `connections` are as the JSON form has them; the two `ends` of a connection are
    symbols joined by a pipe, `linked` in the file, or else only drawn next to it. `symbols` are
    those of pictures, each with its ECLASS code.
    """

    file: str
    name: str
    title: str
    version: str
    writer: str
    tags: tuple[Tag, ...]
    servers: tuple[Server, ...]
    services: tuple[Mapping[str, Any], ...]
    symbols: tuple[tuple[str, str], ...]
    connections: tuple[Mapping[str, Any], ...]
    odd: tuple[Oddity, ...]


class MtpRefused(Refusal):
    """A file cannot be read; the message says where, why and what to do."""


@dataclass(frozen=True)
class Oddity:
    """Something for a person to look at; `kind` groups oddities of one sort."""

    kind: str
    place: str
    text: str
    remedy: str
