"""The least disagreement that another value of a reading can leave.

No value of a reading changes the estimates that do not read it. So their chi-square alone is a
bound, and most candidates for a column need not be tried. Chi-square of all estimates but some
follows from that of all by deletion (Cook and Weisberg 1982).
"""

from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import covariance_of, groups_of


@dataclass(frozen=True)
class LeftOut:
    """Estimates compared with each other, at n points.

    Attributes
    ----------
    chi : chi-square of all of them, shape (n,).
    weight : half its second derivative by the estimates, shape (n, observers, observers), (s/m3)^2;
        zero for unusable ones.
    pull : `weight` times the estimates, shape (n, observers), s/m3.
    """

    chi: Array
    weight: Array
    pull: Array

    def least(self, observers: np.ndarray) -> Array:
        """Chi-square without some observers, by flags, shape (n,)."""
        block = self.weight[:, observers][:, :, observers]
        pull = self.pull[:, observers]
        back = np.linalg.pinv(block, rcond=limits.PSEUDO_INVERSE, hermitian=True)
        return np.asarray(self.chi - np.einsum("ni,nij,nj->n", pull, back, pull))


def left_out(ruleset: Ruleset, observed: Observed) -> LeftOut:
    """What each of the estimates adds to their disagreement."""
    n, count = len(observed), len(ruleset.observers)
    chi, weight, pull = np.zeros(n), np.zeros((n, count, count)), np.zeros((n, count))
    for valid, members, basis in groups_of(ruleset, observed.valid):
        spread = covariance_of(basis, observed.covariance, valid, members)
        own = basis.T @ np.linalg.solve(
            spread, np.broadcast_to(basis, (len(members), *basis.shape))
        )
        flows = observed.flows[valid][:, members].T
        towards = np.einsum("nij,nj->ni", own, flows)
        weight[np.ix_(members, valid, valid)] = own
        pull[np.ix_(members, valid)] = towards
        chi[members] = np.einsum("ni,ni->n", towards, flows)
    return LeftOut(chi, weight, pull)
