"""Residuals of any directed graph: they are right, complete, and each stands once; what
`downstream(name)` sums, graph by graph; in a long plant flows are compared with those nearby."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.redundancy import residual_basis

from rulec.algebra.continuity import FlowGraph, flows_by_continuity
from rulec.algebra.eliminate import Span
from rulec.commands import matrix
from rulec.commands.matrix import left_out
from rulec.language.diagnostics import Place, Refused
from rulec.language.expression import Expression
from rulec.limits import MOST_RULES
from rulec.passes import derive_signatures
from rulec.passes.derive_residuals import Residual, derive_residuals
from rulec.passes.downstream import Downstream, Undefined
from rulec.passes.limits import MOST_SUMMED
from rulec.passes.link import Network, junctions, link
from rulec.passes.pipeline import compile_plant, run_passes
from rulec.passes.types import Compilation
from tests.bench.rigs import chain
from tests.conftest import compiled

KINDS = ("pump", "power", "resis", "flow")
Connections = Iterable[tuple[str, str]]

Kinds = st.lists(st.sampled_from(KINDS), unique=True, max_size=3)
Graphs = st.integers(1, 9).flatmap(
    lambda n: st.tuples(
        st.lists(Kinds, min_size=n, max_size=n),
        st.sets(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=14),
        st.booleans(),
    )
)


def module(name: str, kinds: Iterable[str], declared: bool, measured: bool) -> Any:
    """A module with nothing but the names of its observers, all compared or none."""
    of = SimpleNamespace(
        observers={k: SimpleNamespace(name=k, expression=Expression("0", None)) for k in kinds},  # type: ignore[arg-type]
        residuals=tuple((a, b) for a in kinds for b in kinds if a < b) if declared else (),
        provides={"loss": "dp"} if measured else {},
        gathers=(),
        states={},
        flows={},
        cuts=False,
    )
    return SimpleNamespace(name=name, type=of)


def plant(
    modules: Mapping[str, Iterable[str]],
    connections: Connections,
    declared: bool,
    measured: Iterable[str] = (),
) -> Any:
    """A plant; the modules of `measured` provide a loss."""
    made = {n: module(n, kinds, declared, n in measured) for n, kinds in modules.items()}
    connected = tuple(sorted(set(connections)))
    observers = [f"{m.name}.{o}" for m in made.values() for o in m.type.observers]
    given = {"name": "p", "modules": made, "connections": connected, "observers": observers}
    return SimpleNamespace(**given, place=Place("p"))


def linked(graph: tuple[list[list[str]], set[tuple[int, int]], bool]) -> Network | None:
    """A network, unless nothing can be compared or something can never flow."""
    kinds, edges, declared = graph
    names = [f"M{i}" for i in range(len(kinds))]
    connections = ((names[a], names[b]) for a, b in edges if a != b)
    try:
        return link(plant(dict(zip(names, kinds, strict=True)), connections, declared))
    except Refused as refused:
        if {d.code for d in refused.diagnostics} <= {"KB087", "KB090"}:
            return None
        raise


def table(network: Network, derived: tuple[Residual, ...]) -> Array:
    """Factors of the observers in each residual, shape (residuals, observers)."""
    names = network.plant.observers
    rows = np.zeros((len(derived), len(names)))
    for row, residual in zip(rows, derived, strict=True):
        for sign, observer in residual.terms:
            row[names.index(observer)] += sign
    return rows


@settings(max_examples=200, deadline=None)
@given(Graphs)
def test_residuals_are_complete(graph: Any) -> None:
    """They span exactly what the runtime's basis spans, with whole signs, each under one name."""
    network = linked(graph)
    if network is None:
        return
    derived, modules = derive_residuals(network), network.plant.modules
    rows = table(network, derived)
    observers = [SimpleNamespace(module=m.name) for m in modules.values() for _ in m.type.observers]
    plant = SimpleNamespace(modules=modules, junctions=network.balances, observers=observers)
    basis = residual_basis(cast(Ruleset, plant), np.ones(len(observers), dtype=bool))
    assert len({r.id for r in derived}) == len(derived)
    assert set(np.unique(rows)) <= {-1.0, 0.0, 1.0}
    ranks = [
        np.linalg.matrix_rank(m, tol=1e-9) if m.size else 0
        for m in (rows, np.vstack([rows, basis]))
    ]
    assert [len(basis)] * 2 == ranks


@settings(max_examples=200, deadline=None)
@given(Graphs)
def test_a_flow_is_told_exactly_if_the_balances_fix_it(graph: Any) -> None:
    """By continuity follows what linear algebra finds, and its sum is right for any circulation."""
    network = linked(graph)
    if network is None:
        return
    names = list(network.plant.modules)
    balances = np.zeros((len(network.balances), len(names)))
    for row, balance in zip(balances, network.balances, strict=True):
        row[[names.index(m) for m in balance.outlets]] += 1
        row[[names.index(m) for m in balance.inlets]] -= 1
    _, sizes, vectors = np.linalg.svd(balances, full_matrices=True)
    flows = vectors[int(np.sum(sizes > 1e-9)) :]
    for kind in KINDS:
        own = [m.name for m in network.plant.modules.values() if kind in m.type.observers]
        measured = flows[:, [names.index(m) for m in own]]
        found = flows_by_continuity(network.graph, own)
        for name in set(names) - set(own):
            flow = flows[:, names.index(name)]
            rest = flow - measured @ np.linalg.lstsq(measured, flow, rcond=None)[0] if own else flow
            is_fixed = bool(np.abs(rest).max(initial=0) < 1e-9 and np.abs(flow).max(initial=0) > 0)
            assert (name in found) == is_fixed
            if is_fixed:
                terms = found[name].terms.items()
                total = sum(sign * flows[:, names.index(m)] for m, sign in terms)
                assert flow == pytest.approx(total, abs=1e-9)


CASES = {
    "row": ("A>M M>N", "M N", "M N"),
    "a pipe on the only way loses nothing": ("A>P P>M", "M", "M"),
    "parallel: the first of equally short ones": ("A>M A>N M>C N>C", "M N C", "M C"),
    "parallel: the measured one": ("A>P A>N P>C N>C", "N C", "N C"),
    "parallel: the measured one may be longer": ("A>P A>M M>N P>C N>C", "M N C", "M N C"),
    "a split within a branch": ("A>P A>M M>N M>Q N>R Q>R P>C R>C", "M N R C", "M N R C"),
    "parallel pipes lose nothing": ("A>P A>Q P>C Q>C", "C", "C"),
    "ends apart, nothing measured behind": ("A>M M>P M>Q", "M", "M"),
    "ends apart": ("A>M M>N M>Q", "M N", "the paths through 'N', 'Q' end at different places"),
    "no branch measured throughout": (
        "A>M A>N M>P N>Q P>C Q>C",
        "M N C",
        "the paths through 'M', 'N' meet again, but none is measured throughout",
    ),
    "recirculation": ("A>M R>M M>E M>R", "M E", "M E"),
    "recirculation, return measured": ("A>M R>M M>E M>R", "M E R", "M E"),
    "recirculation over two mixers": ("A>M R>M M>N N>E N>R", "M N E", "M N E"),
    "recirculation before a split": ("A>M R>M M>K M>L M>R K>E L>E", "M L E", "M L E"),
    "a loop in one of two branches": ("A>M A>P M>N R>N N>R N>C P>C", "M N C", "M N C"),
    "in the loop: up to the own inlet": ("S>M A>M M>E M>A", "M E", "M"),
    "closed circuit": ("A>M M>N N>A", "M N", "M N"),
    "closed circuit, parallel": ("A>M A>N M>T N>T T>A", "M N", "M"),
    "no way out": ("A>M S>M M>P P>M", "M", "the path never ends"),
}


@pytest.mark.parametrize("name", CASES)
def test_sum_for_module_a(name: str) -> None:
    """Modules that the sum of A counts, or why there is none."""
    text, measured, expected = CASES[name]
    connections = [tuple(c.split(">")) for c in text.split()]
    names = dict.fromkeys(m for pair in connections for m in pair)
    made = plant({m: ["pump"] for m in names}, connections, True, measured.split())  # type: ignore[arg-type]
    balances = junctions(made)
    ways = Downstream(made, balances, FlowGraph.of(balances, names))
    try:
        found = " ".join(m for m, _ in ways.sum("A", "loss"))
    except Undefined as why:
        found = why.reason
    assert expected == found


def test_long_sums_follow_from_near_ones(tmp_path: Path) -> None:
    """Every comparison of a sum of all flows upstream is a sum of residuals, none is lost."""
    (tmp_path / "plant.yaml").write_text(chain(60), encoding="utf-8")
    derived = run_passes(Compilation(path=tmp_path), "residuals")
    assert max(len(r.terms) for r in derived.residuals) <= MOST_SUMMED + 1
    assert max(len(flow.terms) for flow in derived.network.sums.values()) == 50
    number = {name: i for i, name in enumerate(derived.plant.observers)}
    span = Span()
    for residual in derived.residuals:
        span.add({number[o]: sign for sign, o in residual.terms})
    for (module, kind), flow in derived.network.sums.items():
        for own in derived.plant.modules[module].type.observers:
            terms = {number[f"{m}.{kind}"]: sign for m, sign in flow.terms.items()}
            assert span.holds({**terms, number[f"{module}.{own}"]: -1}), (module, kind)


def test_a_fault_keeps_the_rules_that_show_it_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two mixers in series, five dosing modules each."""
    (tmp_path / "plant.yaml").write_text(chain(12), encoding="utf-8")
    whole = compile_plant(tmp_path)
    most = max(len(cells) for cells in whole.cells_of_fault.values())
    assert 5 < most <= MOST_RULES
    assert not left_out(compiled("abc"))
    monkeypatch.setattr(derive_signatures, "MOST_RULES", 5)
    monkeypatch.setattr(matrix, "MOST_RULES", 5)
    few = compile_plant(tmp_path)
    assert "the 5 residuals that tell it first" in left_out(few)
    assert left_out(few) in matrix.matrix_page(few)
    for fault in whole.faults:
        cells, kept = whole.cells_of_fault[fault.id], few.cells_of_fault[fault.id]
        assert kept == tuple(c for c in cells if c in kept)
        assert len(kept) == min(len(cells), 5)
        left = [c.detectable for c in cells if c not in kept]
        assert max((c.detectable for c in kept), default=0.0) <= min(left, default=np.inf)
