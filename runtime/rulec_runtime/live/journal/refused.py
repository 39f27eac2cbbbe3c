"""Permanent and temporary failures of a journal."""

from rulec_runtime.output.refusal import Refusal


class JournalRefused(Refusal):
    """A journal cannot be used, or not in this way; the message says why and what to do."""


class JournalTrouble(Refusal):
    """A failure that may pass, such as a full disk or a lost server. Nothing was stored, and the
    call can be repeated; the message is for people."""
