"""A verdict for every sample, as data."""

from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array


@dataclass(frozen=True)
class Trace:
    """Per sample: verdict, and per fault degree and bounds, shape (faults, n).

    `faults` are the ids of those faults: all listed ones, and others if they are named.
    """

    time: Array
    verdict: tuple[str, ...]
    degree: Array
    lower: Array
    upper: Array
    faults: tuple[str, ...]

    def of(self, fault: str) -> tuple[Array, Array, Array]:
        """Degree and bounds of one fault, shape (n,) each; 0 if no sample names it."""
        if fault not in self.faults:
            none = np.zeros(len(self.time))
            return none, none, none
        row = self.faults.index(fault)
        return self.degree[row], self.lower[row], self.upper[row]
