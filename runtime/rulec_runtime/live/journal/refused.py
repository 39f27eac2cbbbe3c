"""Permanent and temporary failures of a journal."""

from importlib.util import find_spec

from rulec_runtime.output.refusal import Refusal, to_install


class JournalRefused(Refusal):
    """A journal cannot be used, or not in this way; the message says why and what to do."""


class JournalTrouble(Refusal):
    """A failure that may pass, such as a full disk or a lost server. Nothing was stored, and the
    call can be repeated; the message is for people."""


def needs(package: str, extra: str) -> None:
    """Raises `JournalRefused` if a package of an extra of rulec-runtime is not installed."""
    if find_spec(package) is None:
        raise JournalRefused(f"this needs the package '{package}': {to_install(extra)}")
