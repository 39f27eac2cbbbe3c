"""Refusals to compare or to plan; each message says why and what to do."""

from __future__ import annotations

from rulec_runtime.output.refusal import Refusal


class MismatchRefused(Refusal):
    """The comparison cannot be made."""


class ExperimentRefused(Refusal):
    """No experiment can be planned."""
