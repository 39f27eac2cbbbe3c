"""Why a sheet gives no module type."""

from __future__ import annotations

from rulec_runtime.output.refusal import Refusal


class CurveRefused(Refusal):
    """The points cannot be used; the message says why and what to do."""
