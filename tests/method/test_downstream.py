"""What `downstream(name)` sums, graph by graph."""

import pytest

from rulec.algebra.continuity import FlowGraph
from rulec.passes.downstream import Downstream, Undefined
from rulec.passes.link import junctions
from tests.method.test_any_graph import plant

CASES = {
    "row": ("A>M M>N", "M N", "M N"),
    "a pipe on the only way loses nothing": ("A>P P>M", "M", "M"),
    "parallel: the first of equally short ones": ("A>M A>N M>C N>C", "M N C", "M C"),
    "parallel: the measured one": ("A>P A>N P>C N>C", "N C", "N C"),
    "parallel: the measured one may be longer": ("A>P A>M M>N P>C N>C", "M N C", "M N C"),
    "a split within a branch": ("A>P A>M M>N M>Q N>R Q>R P>C R>C", "M N R C", "M N R C"),
    "parallel pipes lose nothing": ("A>P A>Q P>C Q>C", "C", "C"),
    "ends apart, nothing measured behind": ("A>M M>P M>Q", "M", "M"),
    "ends apart": ("A>M M>N M>Q", "M N", "the ways through 'N', 'Q' end at different places"),
    "no branch measured throughout": (
        "A>M A>N M>P N>Q P>C Q>C",
        "M N C",
        "the ways through 'M', 'N' meet again, but none is measured throughout",
    ),
    "recirculation": ("A>M R>M M>E M>R", "M E", "M E"),
    "recirculation, return measured": ("A>M R>M M>E M>R", "M E R", "M E"),
    "recirculation over two mixers": ("A>M R>M M>N N>E N>R", "M N E", "M N E"),
    "recirculation before a split": ("A>M R>M M>K M>L M>R K>E L>E", "M L E", "M L E"),
    "a loop in one of two branches": ("A>M A>P M>N R>N N>R N>C P>C", "M N C", "M N C"),
    "in the loop: up to the own inlet": ("S>M A>M M>E M>A", "M E", "M"),
    "closed circuit": ("A>M M>N N>A", "M N", "M N"),
    "closed circuit, parallel": ("A>M A>N M>T N>T T>A", "M N", "M"),
    "no way out": ("A>M S>M M>P P>M", "M", "the way never ends"),
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
