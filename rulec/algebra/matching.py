"""Which equations determine which unknowns: matchings of a bipartite graph."""

from collections import deque
from collections.abc import Sequence


def match(readers: Sequence[Sequence[int]]) -> list[int | None]:
    """Assign to as many unknowns as possible an equation of their own.

    Unknowns are taken in order, and an unknown once matched stays matched. So if not all can be
    matched, the matched set is the first possible one in this order.

    Parameters
    ----------
    readers : per unknown the numbers of the equations that contain it.

    Returns
    -------
    Per unknown the number of its equation, or None.

    Examples
    --------
    >>> match([[0, 1], [0], [0, 1]])
    [1, 0, None]

    Source: augmenting paths, Kuhn 1955; the order makes it the greedy algorithm of the
    transversal matroid (Edmonds and Fulkerson 1965).
    """
    owner: dict[int, int] = {}
    partner: list[int | None] = [None] * len(readers)
    for unknown in range(len(readers)):
        reached_from, free = _search(readers, owner, unknown)
        while free is not None:
            taker = reached_from[free]
            owner[free] = taker
            partner[taker], free = free, partner[taker]
    return partner


def _search(
    readers: Sequence[Sequence[int]], owner: dict[int, int], start: int
) -> tuple[dict[int, int], int | None]:
    """Search breadth-first along alternating paths for the first equation without an owner."""
    reached_from: dict[int, int] = {}
    queue = deque([start])
    while queue:
        unknown = queue.popleft()
        for equation in readers[unknown]:
            if equation in reached_from:
                continue
            reached_from[equation] = unknown
            if equation not in owner:
                return reached_from, equation
            queue.append(owner[equation])
    return reached_from, None


def surplus(
    readers: Sequence[Sequence[int]], partner: Sequence[int | None], equations: int
) -> tuple[list[int], list[int]]:
    """The over-determined part: surplus equations and all that they compete with.

    Returns
    -------
    Its equations and the unknowns they contain; both empty if every equation is matched (Dulmage
    and Mendelsohn 1958).
    """
    holds: list[list[int]] = [[] for _ in range(equations)]
    for unknown, numbers in enumerate(readers):
        for equation in numbers:
            holds[equation].append(unknown)
    taken = {equation for equation in partner if equation is not None}
    queue = deque(i for i in range(equations) if i not in taken)
    found, unknowns = set(queue), set()
    while queue:
        for unknown in holds[queue.popleft()]:
            unknowns.add(unknown)
            own = partner[unknown]
            if own is not None and own not in found:
                found.add(own)
                queue.append(own)
    return sorted(found), sorted(unknowns)
