"""What is left when no name fits any more: a term without a name, or a driver nobody recorded."""

from __future__ import annotations

from runtime.mismatch.hidden import Reconstruction, reconstruct
from runtime.mismatch.search import Search


def rest_of(found: Search) -> tuple[Search, Reconstruction | None]:
    """Look for structure in what is left."""
    explained = sum(record.gain for record in found.accepted)
    return found, reconstruct(found.best.fitted, explained)
