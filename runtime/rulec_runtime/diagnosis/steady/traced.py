"""A verdict for every sample, as data."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.contract.plan import Array


@dataclass(frozen=True)
class Trace:
    """Per sample: verdict, and per fault degree and bounds, shape (faults, n)."""

    time: Array
    verdict: tuple[str, ...]
    degree: Array
    lower: Array
    upper: Array
