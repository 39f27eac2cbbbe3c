"""What stops an import, and what is only odd."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.output.refusal import Refusal


class MtpRefused(Refusal):
    """A file that is not read further; the message says where, why and what to do."""


@dataclass(frozen=True, kw_only=True)
class Oddity:
    """Something that a person should look at: `kind` is what all of its sort have in common."""

    kind: str
    place: str
    text: str
    remedy: str
