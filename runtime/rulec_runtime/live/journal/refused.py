"""Why an event cannot be kept: for good, or for now."""

from __future__ import annotations

from importlib.util import find_spec

from rulec_runtime.output.refusal import Refusal, to_install


class JournalRefused(Refusal):
    """A journal cannot be used, or not so; the message says why and what to do."""


class JournalTrouble(Refusal):
    """Something that may pass: a full disk, a server that is gone. What was to be kept is not kept
    and can be handed over again; the message is for people."""


def needs(package: str, extra: str) -> None:
    """To be called before what imports a package that an extra of rulec-runtime brings.

    Raises `JournalRefused` if it is not installed.
    """
    if find_spec(package) is None:
        raise JournalRefused(f"this needs the package '{package}': {to_install(extra)}")
