"""Fixtures of the runtime's tests."""

import pytest
from rulec_runtime.contract.ruleset import Ruleset

from tests.runtime.reports import EXAMPLES, Judged, judge


@pytest.fixture(scope="session")
def leaking(abc: Ruleset) -> Judged:
    """The example with a fault that grows in steps, and its truth."""
    return judge(EXAMPLES / "leakage_A.csv", abc, EXAMPLES / "leakage_A.truth.csv")


@pytest.fixture(scope="session")
def healthy(abc: Ruleset) -> Judged:
    return judge(EXAMPLES / "healthy.csv", abc)
