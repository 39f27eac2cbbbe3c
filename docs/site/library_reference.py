"""The page of all module types that come with rulec, each with a picture of its laws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from rulec.knowledge.check_knowledge import check_knowledge
from rulec.knowledge.module_type import ModuleType, Signal
from rulec.knowledge.read import read_files
from rulec.knowledge.values_at import values_at

KB = Path(__file__).parents[2] / "kb"
WIDTH, HEIGHT, POINTS = 260, 130, 60
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd")
WATER = {"density": 998.2, "viscosity": 0.001002}
"""Water at 20 degC, for laws that ask the fluid. Origin: IAPWS-95, by CoolProp."""

Curve = list[tuple[float, float]]


def library_page() -> str:
    """Markdown with a section per module type."""
    (sources,), _, _ = read_files([KB])
    types = check_knowledge(sources).modules
    parts = [
        "# Library",
        "Module types that come with rulec. A picture shows the flow that each observer estimates"
        " over one reading, the others at their typical values.",
    ]
    for name in sorted(types):
        parts += _section(types[name])
    return "\n\n".join(parts) + "\n"


def _section(kind: ModuleType) -> Iterator[str]:
    yield f"## {kind.name}"
    yield kind.title + "."
    if picture := _picture(kind):
        yield picture
    signals = (f"`{s.name}` {s.quantity} ({s.unit.text})" for s in kind.signals.values())
    lines = ["| | |", "|---|---|", f"| signals | {', '.join(signals)} |"]
    laws = (f"`{p[-1]}` {a.text}" for p, a in kind.laws().items() if a)
    for title, told in (
        ("accuracy", "; ".join(laws)),
        ("observers", "; ".join(f"`{o.name}` {o.origin.source}" for o in kind.observers.values())),
        ("faults", ", ".join(f"{use.fault}({use.target})" for use in kind.faults)),
    ):
        if told:
            lines.append(f"| {title} | {told.replace('|', '/')} |")
    yield "\n".join(lines)


def _picture(kind: ModuleType) -> str:
    """Flows over the reading that most observers follow, as SVG; empty where none follows one."""
    best: tuple[Signal | None, dict[str, Curve]] = (None, {})
    for signal in kind.signals.values():
        curves = dict(_curves(kind, signal))
        if len(curves) > len(best[1]):
            best = signal, curves
    return _drawn(best[0], best[1]) if best[0] is not None else ""


def _curves(kind: ModuleType, signal: Signal) -> Iterator[tuple[str, Curve]]:
    """Curves of the observers that change with a reading."""
    if signal.reference is None or not signal.reference:
        return
    low, high = signal.minimum or 0.0, signal.highest or 2.0 * signal.reference
    high = min(high, 2.5 * signal.reference) if signal.reference > 0 else high
    steps = [low + (high - low) * i / (POINTS - 1) for i in range(POINTS)]
    rows = [(x, _flows(kind, {signal.name: x})) for x in steps]
    for name in kind.observers:
        points = [(x, flows[name]) for x, flows in rows if name in flows]
        flows = [y for _, y in points]
        if len(points) > POINTS // 4 and max(flows) - min(flows) > 1e-6 * max(map(abs, flows)):
            yield name, points


def _flows(kind: ModuleType, changed: Mapping[str, float]) -> dict[str, float]:
    """What the observers estimate, SI, where the module alone says it."""
    usual = {s.name: s.reference for s in kind.signals.values() if s.reference is not None}
    found = values_at(kind, {**WATER, **usual, **changed})
    return {o: found[o] for o in kind.observers if o in found and math.isfinite(found[o])}


def _drawn(signal: Signal, curves: Mapping[str, Curve]) -> str:
    points = [point for curve in curves.values() for point in curve]
    (x0, x1), (y0, y1) = _ends(x for x, _ in points), _ends(y for _, y in points)
    y0 = min(y0, 0.0)

    def at(x: float, y: float) -> str:
        across = 30 + (WIDTH - 40) * (x - x0) / (x1 - x0)
        return f"{across:.1f},{HEIGHT - 24 - (HEIGHT - 34) * (y - y0) / (y1 - y0):.1f}"

    lines = [
        f'<svg role="img" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" fill="none"'
        ' stroke="currentColor" font-size="9">',
        f'<path d="M30 6V{HEIGHT - 24}H{WIDTH - 8}"/>',
        f'<g stroke="none" fill="currentColor"><text x="2" y="12">{y1 * 3600:.3g} m3/h</text>'
        f'<text x="30" y="{HEIGHT - 10}">{signal.name} {signal.unit.from_si(x0):.3g} to'
        f" {signal.unit.from_si(x1):.3g} {signal.unit.text}</text></g>",
    ]
    for (name, curve), colour in zip(curves.items(), COLOURS, strict=False):
        path = " ".join(at(x, y) for x, y in curve)
        lines.append(
            f'<polyline stroke="{colour}" points="{path}"><title>{name}</title></polyline>'
        )
    return "".join([*lines, "</svg>"])


def _ends(values: Iterable[float]) -> tuple[float, float]:
    low_high = sorted(values)
    return low_high[0], low_high[-1]
