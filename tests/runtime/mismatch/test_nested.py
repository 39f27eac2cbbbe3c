"""A term without a name and a law that it holds are told instead of each other, never both."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch.search.basis import basis_over
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.nested import beside, holds

DRIVER = np.linspace(0.0, 1.0, 200)
SLOPES = 1.0 + 0.5 * np.sin(np.arange(200.0))
"""How an error at the place shows in each row."""

SMOOTH = SLOPES * np.exp(-1.5 * DRIVER)
"""A law that follows the driver of the term, at its place, as slip does a temperature."""

BAND = SLOPES * np.exp(-(((DRIVER - 0.5) / 0.1) ** 2))
"""A law that shows in a band of that driver alone."""

ELSEWHERE = np.cos(7.0 * np.arange(200.0))
"""A law that follows something else."""


def term(name: str = "Q_law~T", driver: Array = DRIVER, length: float = 0.4) -> Term:
    """A term over a driver, of which each row has a value."""
    basis, spot = basis_over(driver, length), cast(DisturbanceLocation, None)
    columns = SLOPES[:, None] * basis.at(driver)
    return Term(name, "Q_law", spot, "T", SLOPES, basis, 1.0, columns)


def model(laws: dict[str, Array], terms: tuple[Term, ...] = ()) -> Model:
    """A model with one law, by the slopes of its unknowns; those with a null are strengths."""
    unknowns = [SimpleNamespace(id=n, null=0.0 if n.startswith("k") else None) for n in laws]
    fake = SimpleNamespace(
        setting=SimpleNamespace(joined=[SimpleNamespace(unknowns=unknowns)] if laws else []),
        prior=SimpleNamespace(names=tuple(laws)),
        raw=np.stack([*laws.values()], axis=1) if laws else np.zeros((len(DRIVER), 0)),
        terms=terms,
    )
    return cast(Model, fake)


def test_a_term_holds_what_is_a_special_case_of_it() -> None:
    """Up to a law's own error of form; what happens in a band is more than a smooth term can be."""
    assert holds([term()], SMOOTH)
    assert holds([term()], SMOOTH + 0.02 * ELSEWHERE)
    for law in (SMOOTH + 0.2 * ELSEWHERE, BAND, ELSEWHERE):
        assert not holds([term()], law)
    assert holds([term(length=0.1)], BAND)
    assert not holds([], SMOOTH)


def test_a_term_is_told_beside_a_law_that_it_does_not_hold() -> None:
    """A threshold whose slope looks like a term leaves that open, as does a strength that no row
    shows."""
    shaped = {"x": SMOOTH, "k": ELSEWHERE, "k2": np.zeros(len(DRIVER))}
    for laws, told in (({"k": SMOOTH}, 0), ({"k": ELSEWHERE}, 1), (shaped, 1)):
        assert told == len(beside(model(laws), [term()]))


def test_a_term_that_shows_alike_is_not_told_twice() -> None:
    """A smooth term is a special case of a rough one over the same driver, whichever came first;
    one over another driver is not."""
    rough, smooth = term("rough", length=0.1), term("smooth")
    other = term("other", driver=np.sin(3.0 * np.arange(200.0)))
    for first, second in ((rough, smooth), (smooth, rough)):
        assert ["other"] == [t.name for t in beside(model({}, (first,)), [second, other])]
