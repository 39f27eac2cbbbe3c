"""Problems of an import: refusals stop it, oddities do not."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.output.refusal import Refusal


class MtpRefused(Refusal):
    """A file cannot be read; the message says where, why and what to do."""


@dataclass(frozen=True)
class Oddity:
    """Something for a person to look at; `kind` groups oddities of one sort."""

    kind: str
    place: str
    text: str
    remedy: str
