"""A term without a name and a law that it holds are told instead of each other, never both."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch.search.basis import basis_over
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.nested import beside, holds

DRIVER = np.linspace(0.0, 1.0, 200)
SLOPES = 1.0 + 0.5 * np.sin(np.arange(200.0))
"""How an error at the place shows in each row."""


def term(name: str = "Q_law~T", driver: Array = DRIVER, length: float = 0.4) -> Term:
    """A term over a driver, of which each row has a value."""
    spot = DisturbanceLocation(
        id="Q_law",
        kind="definition",
        module="A",
        place="Q_law",
        title="",
        unit="1",
        factor=1.0,
        observers=(),
        unknown="",
    )
    basis = basis_over(driver, length)
    return Term(
        name=name,
        spot="Q_law",
        changed=spot,
        driver="T",
        slopes=SLOPES,
        basis=basis,
        norm=1.0,
        columns=SLOPES[:, None] * basis.at(driver),
    )


def model(laws: dict[str, Array], terms: tuple[Term, ...] = ()) -> Model:
    """A model with one law, by the slopes of its unknowns; those with a null are strengths."""
    unknowns = [SimpleNamespace(id=n, null=0.0 if n.startswith("k") else None) for n in laws]
    joined = [SimpleNamespace(unknowns=unknowns)] if laws else []
    fake = SimpleNamespace(
        setting=SimpleNamespace(joined=joined),
        prior=SimpleNamespace(names=tuple(laws)),
        raw=np.stack([*laws.values()], axis=1) if laws else np.zeros((len(DRIVER), 0)),
        terms=terms,
    )
    return cast(Model, fake)


SMOOTH = SLOPES * np.exp(-1.5 * DRIVER)
"""A law that follows the driver of the term, at its place, as slip does a temperature."""

BAND = SLOPES * np.exp(-(((DRIVER - 0.5) / 0.1) ** 2))
"""A law that shows in a band of that driver alone."""

ELSEWHERE = np.cos(7.0 * np.arange(200.0))
"""A law that follows something else."""


@pytest.mark.parametrize(
    ("law", "held"),
    [
        (SMOOTH, True),
        (SMOOTH + 0.02 * ELSEWHERE, True),  # less than a law's own error of form
        (SMOOTH + 0.2 * ELSEWHERE, False),
        (BAND, False),  # what happens in a band is more than a smooth term can be
        (ELSEWHERE, False),
    ],
)
def test_a_term_holds_what_is_a_special_case_of_it(law: Array, held: bool) -> None:
    assert holds([term()], law) is held


def test_a_rough_term_holds_what_happens_in_a_band() -> None:
    assert holds([term(length=0.1)], BAND)


def test_no_term_holds_nothing() -> None:
    assert not holds([], SMOOTH)


def test_a_term_is_not_told_beside_a_law_that_it_holds() -> None:
    assert not beside(model({"k": SMOOTH}), [term()])


def test_a_term_is_told_beside_a_law_that_it_does_not_hold() -> None:
    (own,) = beside(model({"k": ELSEWHERE}), [term()])
    assert own.name == "Q_law~T"


def test_what_only_shapes_a_law_does_not_count() -> None:
    """A threshold whose slope looks like a term leaves that open, as does a strength that no row
    shows."""
    shaped = model({"x": SMOOTH, "k": ELSEWHERE, "k2": np.zeros(len(DRIVER))})
    assert len(beside(shaped, [term()])) == 1


def test_a_term_that_shows_alike_is_not_told_twice() -> None:
    """A smooth term is a special case of a rough one over the same driver, whichever came first;
    one over another driver is not."""
    rough, smooth = term("rough", length=0.1), term("smooth")
    other = term("other", driver=np.sin(3.0 * np.arange(200.0)))
    assert ["other"] == [t.name for t in beside(model({}, (rough,)), [smooth, other])]
    assert ["other"] == [t.name for t in beside(model({}, (smooth,)), [rough, other])]
