"""Large plants to compile, as plant.yaml text."""

TYPES = ("dosing-pcp", "dosing-pcp", "dosing-pcp", "dosing-membrane", "dosing-centrifugal")
FLOWS = (519.0, 519.0, 519.0, 345.0, 530.0)
LOSS = 0.3  # bar, of all mixers of a chain together: more than that a centrifugal pump cannot lift
RIG = 7


def chain(modules: int) -> str:
    """Static mixers in series, five dosing modules each; the mixers widen with their flow.

    Every leakage shows at all mixers downstream, so residuals, rules and effort grow with the
    square of the length: that is in the method, not in the compiler.
    """
    return _plant("chain", *_train("", modules, -(-modules // 6)))


def side_by_side(modules: int) -> str:
    """Rigs like the paper's, five dosing modules and two mixers each, without connection."""
    lines: list[str] = []
    connections: list[str] = []
    for i in range(round(modules / RIG)):
        more_lines, more = _train(f"R{i}_", RIG, 2)
        lines, connections = lines + more_lines, connections + more
    return _plant("rigs", lines, connections)


def _train(prefix: str, modules: int, mixers: int) -> tuple[list[str], list[str]]:
    mixers = max(1, min(mixers, modules - 1))
    dosing, loss, flow = modules - mixers, LOSS / mixers, 0.0
    lines: list[str] = []
    connections: list[str] = []
    for k in range(mixers):
        share = dosing * (k + 1) // mixers - dosing * k // mixers
        for j in range(share):
            name, kind = f"{prefix}D{k}_{j}", j % len(TYPES)
            lines.append(f"  {name}: {{type: {TYPES[kind]}}}")
            connections.append(f"{name} -> {prefix}M{k}")
            flow += FLOWS[kind]
        value = f"value: {loss / flow**2!r}, unit: bar/(l/h)**2, u: {0.004 * loss / flow**2!r}"
        lines.append(
            f"  {prefix}M{k}: {{type: static-mixer, reference: {{dp: {loss!r}}}, "
            f"parameters: {{k2: {{{value}, source: generated}}}}}}"
        )
        if k:
            connections.append(f"{prefix}M{k - 1} -> {prefix}M{k}")
    return lines, connections


def _plant(name: str, lines: list[str], connections: list[str]) -> str:
    joined = "".join(f"  - {c}\n" for c in connections)
    return (
        f"plant: {name}\ntitle: generated\nmodules:\n"
        + "\n".join(lines)
        + f"\nconnections:\n{joined}"
    )
