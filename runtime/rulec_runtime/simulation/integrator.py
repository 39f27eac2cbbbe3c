"""The integrator: compiled by numba once, for all plants.

A plan is data (see `contract.plan`) that an interpreter reads: an analysis may try hundreds of
variants of a model without compiling any. Derivatives by chosen parameters are carried along
exactly (forward mode).

Source: Runge and Kutta's method of fourth order with a fixed step per sample, split into a few
pieces where the fastest mode in the stages demands it (Hairer, Noersett, Wanner 1993, IV.2). Where
that is not enough, as at an overflow edge, the linearly implicit method of second order with one
Jacobian a step, ROS2 (Verwer, Spee, Blom, Hundsdorfer 1999), which is stable for any step; its
steps are split until the embedded method of first order agrees.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rulec_runtime.simulation.code_cache import can_be_cached
from rulec_runtime.simulation.tape import Tape

try:
    CACHED = can_be_cached(__file__)
    from numba import njit as compiled
except ImportError:  # numba is optional at an operator's station: slow, but the same numbers
    CACHED = False

    def compiled(**_: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:  # type: ignore[no-redef]
        """Leave the function as it is."""
        return lambda function: function


LIVELY = 1.0
"""Step times rate of the fastest mode beyond which a step is split; Runge-Kutta is stable up to
2.8. Origin: numerical."""

EXACT = 1e-7
"""Error of a step, as a share of each state's peak so far, beyond which it is split. Origin:
numerical."""

PIECES = 4
"""Most pieces of an explicit sample's step; faster modes go implicitly. Origin: numerical."""

GROWN = 256
"""Most pieces where a state grows by itself. Origin: numerical."""

ROUGH = 3e-4
"""Largest difference of the two orders of the implicit method, as a share of each state's largest
value so far; a step that crosses an edge is split until they agree. Origin: numerical."""

SMOOTH = 3.0
"""Bend of the last stage over that of the middle beyond which there is an edge. Origin: assumed."""

FINEST = 256
"""Most pieces of a sample's implicit step. Origin: numerical."""

GAMMA = 1.0 - math.sqrt(0.5)
"""Parameter of the implicit method at which it damps the fastest modes completely. Origin: source,
Verwer, Spee, Blom, Hundsdorfer 1999."""

TINY = 1e-14
"""Lower bound of the arguments of roots and logarithms: a tank that runs empty has no infinite
slope. Origin: numerical."""

STEEPEST = 300.0
"""Upper bound of exponents: beyond, numbers overflow. Origin: numerical."""

HUGE = 1e150
"""A state beyond this ran away. Origin: numerical."""

AT_REST = 1e-18
"""Square of a mode's share of the state below which it counts as at rest. Origin: numerical."""

UNCOUNTED: dict[str, Any] = {"_nrt": False}
"""numba's option for code that allocates nothing: no reference counts of arrays."""

STAGES = (4, 2)
NODES = np.array([[0.0, 0.5, 0.5, 1.0], [0.0, 1.0, 0.0, 0.0]])
WEIGHTS = np.array([1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0])
"""Tableaus of Runge and Kutta's method and of ROS2: number of stages, position of each in the step,
and weights of the explicit method, in which each stage starts from the one before."""


@compiled(cache=CACHED, nogil=True, fastmath=False, error_model="numpy")
def evaluate(
    first: int,
    codes: np.ndarray,
    left: np.ndarray,
    right: np.ndarray,
    begin: int,
    store: np.ndarray,
    width: int,
) -> None:
    """Run the operations from number `begin` on, in the first `width` columns of `store`.

    `store` has a row per value of the plan: the value, then its slopes. `codes` are places in
    `contract.plan.OPERATIONS`. Undefined values (a root below zero, a division by zero) are those
    at the edge of the domain.
    """
    for i in range(begin, codes.shape[0]):
        code, a, b, out = codes[i], left[i], right[i], first + i
        x = store[a, 0]
        y = store[b, 0]
        da = 0.0
        db = 0.0
        if code == 0:
            v, da, db = x + y, 1.0, 1.0
        elif code == 1:
            v, da, db = x - y, 1.0, -1.0
        elif code == 2:
            v, da, db = x * y, y, x
        elif code == 3:
            if y == 0.0:
                y = TINY
            v = x / y
            da, db = 1.0 / y, -v / y
        elif code == 4:
            base = max(x, 0.0)
            if base == 0.0:
                v = 0.0 if y > 0.0 else 1.0
                da = y if y == 1.0 else 0.0
            else:
                v = base**y
                da, db = y * v / base, v * math.log(base)
        elif code == 5:
            if x <= y:
                v, da = x, 1.0
            else:
                v, db = y, 1.0
        elif code == 6:
            if x >= y:
                v, da = x, 1.0
            else:
                v, db = y, 1.0
        elif code == 7:
            v, da = -x, -1.0
        elif code == 8:
            if x > TINY:
                v = math.sqrt(x)
                da = 0.5 / v
            else:
                v = 0.0
        elif code == 9:
            v = abs(x)
            da = 1.0 if x >= 0.0 else -1.0
        elif code == 10:
            v = 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)
        elif code == 11:
            v = math.exp(min(x, STEEPEST))
            da = v
        elif code == 12:
            v = math.log(max(x, TINY))
            da = 1.0 / max(x, TINY)
        elif code == 13:
            v = math.tanh(x)
            da = 1.0 - v * v
        else:
            v = math.nan  # an unknown operation has no value
        store[out, 0] = v
        if code < 7:
            for k in range(1, width):
                store[out, k] = da * store[a, k] + db * store[b, k]
        else:
            for k in range(1, width):
                store[out, k] = da * store[a, k]


class Machine(NamedTuple):
    """Balances at work: their operations and values.

    `store` has a row per value of the plan: in its first `width` columns the value and its slopes
    by the seeds, then those by the states, which only the implicit method needs. All arrays of
    states below have such columns as well, the last axis: the state, then its slopes by the seeds.
    """

    tape: Tape
    store: np.ndarray
    width: int


class Given(NamedTuple):
    """Data at each sample: times, s, `inputs`, shape (n, inputs), and whether each input is `held`
    until the next sample."""

    held: np.ndarray
    time: np.ndarray
    inputs: np.ndarray


@compiled(inline="always")
def _run(machine: Machine, end: int, width: int) -> None:
    """Run the moving operations before number `end`."""
    tape = machine.tape
    codes = tape.codes[:end]
    evaluate(tape.first, codes, tape.left, tape.right, tape.begin, machine.store, width)


@compiled(inline="always")
def _solve(matrix: np.ndarray, right_side: np.ndarray) -> None:
    """Solve a small system for all columns, in place (Gauss); the matrix is used up."""
    n, width = right_side.shape
    for i in range(n):
        pivot = i
        for j in range(i + 1, n):
            if abs(matrix[j, i]) > abs(matrix[pivot, i]):
                pivot = j
        if pivot != i:
            for c in range(n):
                matrix[i, c], matrix[pivot, c] = matrix[pivot, c], matrix[i, c]
            for c in range(width):
                swapped = right_side[i, c]
                right_side[i, c] = right_side[pivot, c]
                right_side[pivot, c] = swapped
        if matrix[i, i] == 0.0:
            matrix[i, i] = TINY
        for j in range(i + 1, n):
            share = matrix[j, i] / matrix[i, i]
            if share != 0.0:
                for c in range(i + 1, n):
                    matrix[j, c] -= share * matrix[i, c]
                for c in range(width):
                    right_side[j, c] -= share * right_side[i, c]
    for i in range(n - 1, -1, -1):
        for c in range(width):
            total = right_side[i, c]
            for j in range(i + 1, n):
                total -= matrix[i, j] * right_side[j, c]
            right_side[i, c] = total / matrix[i, i]


@compiled(inline="always")
def _given(given: Given, j: int, sample: int, share: float) -> float:
    u: float = given.inputs[sample, j]
    if not given.held[j]:
        u += share * (given.inputs[sample + 1, j] - u)
    return u


@compiled(cache=CACHED, nogil=True, fastmath=False, error_model="numpy")
def _follow(machine: Machine, past: Past, when: float, count: int) -> None:
    """Set states with a dead time to what they followed that much earlier, linear between nodes.

    The first `count` nodes are known; outside these the past is constant.
    """
    tape, store, width = machine
    late, nodes, followed = past[:3]
    for j in range(late.shape[0]):
        slot, delay = tape.states[late[j]], tape.afters[late[j]]
        then = when - max(store[delay, 0], 0.0)
        low, high = 0, count - 1
        while high - low > 1:
            middle = (low + high) // 2
            if nodes[middle] <= then:
                low = middle
            else:
                high = middle
        share, steep = 0.0, 0.0
        if high > low:
            share = (then - nodes[low]) / (nodes[high] - nodes[low])
            if 0.0 <= share <= 1.0:
                steep = (followed[high, j, 0] - followed[low, j, 0]) / (nodes[high] - nodes[low])
            share = min(max(share, 0.0), 1.0)
        for c in range(width):
            moved = followed[high, j, c] - followed[low, j, c]
            store[slot, c] = followed[low, j, c] + share * moved
            if c > 0:
                store[slot, c] -= steep * store[delay, c]


@compiled(cache=CACHED, nogil=True, fastmath=False, error_model="numpy")
def _aim(machine: Machine, late: np.ndarray, weight: float, past: np.ndarray, node: int) -> None:
    """Add what states with a dead time follow now, as a lag would, to a node of the past."""
    tape, store, width = machine
    for j in range(late.shape[0]):
        slot, rate, after = tape.states[late[j]], tape.rates[late[j]], tape.afters[late[j]]
        time_constant = max(store[after, 0], TINY)
        for c in range(width):
            aim = store[slot, c] + time_constant * store[rate, c]
            if c > 0:
                aim += store[after, c] * store[rate, 0]
            past[node, j, c] += weight * aim


@compiled(inline="always")
def _load(machine: Machine, x: np.ndarray) -> None:
    tape, store, width = machine
    for i in range(x.shape[0]):
        for c in range(width):
            store[tape.states[i], c] = x[i, c]


@compiled(inline="always")
def _confine(machine: Machine, end: int, x: np.ndarray) -> bool:
    """Keep states within their limits, if these have slots below `end`; whether one was moved."""
    tape, store, width = machine
    moved = False
    for i in range(x.shape[0]):
        for side in range(2):
            slot = tape.lows[i] if side == 0 else tape.highs[i]
            if slot < 0 or slot >= end:
                continue
            limit = store[slot, 0]
            if (side == 0 and x[i, 0] < limit) or (side == 1 and x[i, 0] > limit):
                moved = True
                for c in range(width):
                    x[i, c] = store[slot, c]
    return moved


@compiled(inline="always")
def _linearised(machine: Machine, step: float, matrix: np.ndarray) -> float:
    """Fill the matrix of the implicit method; the rate of the fastest mode, by row sums."""
    tape, store, width = machine
    rate, count = 0.0, matrix.shape[0]
    for i in range(count):
        for c in range(count):
            matrix[i, c] = -GAMMA * step * store[tape.rates[i], width + c]
        matrix[i, i] += 1.0
        if tape.afters[i] >= 0:
            for c in range(count):
                matrix[i, c] = 1.0 if c == i else 0.0
            continue
        total = 0.0
        for c in range(count):
            total += abs(store[tape.rates[i], width + c])
        rate = max(rate, total)
    return rate


@compiled(inline="always")
def _shown_by_stages(
    k: np.ndarray, peak: np.ndarray, step: float
) -> tuple[float, float, float, float]:
    """What the stages of an explicit step show.

    The rate of the fastest mode, its size, whether it grows by itself (positive), and how far an
    edge within the step bends it.
    """
    above, below, turn, bent = 0.0, 0.0, 0.0, 0.0
    for i in range(peak.shape[0]):
        k0, k1, k2, k3 = k[0, i, 0], k[1, i, 0], k[2, i, 0], k[3, i, 0]
        share = peak[i] if peak[i] > 0.0 else abs(step * k0)
        if share > 0.0:
            above += ((k2 - k1) / share) ** 2
            below += (0.5 * step * (k1 - k0) / share) ** 2
            turn += (k2 - k1) * (k1 - k0) / share**2
        # The last stage may be the first to show an edge within a step; a smooth mode bends there
        # as much as between the two in the middle.
        bend = step / 3.0 * (abs(k0 - k1 - k2 + k3) - SMOOTH * abs(k2 - k1))
        bent = max(bent, bend / peak[i] if peak[i] > 0.0 else 0.0)
    # At rest, rounding would look like a fast mode.
    if below > AT_REST:
        return math.sqrt(above / below), math.sqrt(below), turn, bent
    return 0.0, math.sqrt(below), 0.0, bent


@compiled(inline="always")
def _next_pieces(
    pieces: int, lively: bool, error: float, bent: float, growing: bool
) -> tuple[bool, bool, int]:
    """Whether a sample's step is repeated, whether implicitly, and in how many pieces."""
    # A growing mode must not be damped: it is followed until it runs away.
    most = GROWN if growing else PIECES
    switch = (lively or bent > ROUGH) and not growing and pieces >= PIECES
    more = (lively and pieces < most) or ((error > EXACT or bent > ROUGH) and pieces < PIECES)
    again = switch or more
    return again, switch, min(2 * pieces, most) if again else pieces


class Room(NamedTuple):
    """Work arrays of a run, the same for all its steps.

    `x` are the states, `old` those at the last sample, `peak` the largest values so far, `k` the
    rates per stage, `matrix` that of the implicit method.
    """

    x: np.ndarray
    old: np.ndarray
    peak: np.ndarray
    k: np.ndarray
    matrix: np.ndarray


class Past(NamedTuple):
    """What states with a dead time followed.

    `late` numbers these states. At `nodes` (times, s) they `followed`, shape (nodes, late, width):
    first the start, then one mean per step, at its middle, where the mean of inputs that are held
    lies. `mean`, shape (1, late, width), is that of the current step.
    """

    late: np.ndarray
    nodes: np.ndarray
    followed: np.ndarray
    mean: np.ndarray


@compiled(inline="always")
def _room(count: int, width: int) -> Room:
    return Room(
        np.zeros((count, width)),
        np.zeros((count, width)),
        np.zeros(count),
        np.zeros((4, count, width)),
        np.zeros((count, count)),
    )


@compiled(inline="always")
def _past(tape: Tape, time: np.ndarray, x: np.ndarray) -> Past:
    late, width = np.flatnonzero(tape.afters >= 0), x.shape[1]
    lates = late.shape[0]
    nodes = np.zeros(time.shape[0] + 1 if lates else 1)
    followed = np.zeros((nodes.shape[0], lates, width))
    nodes[0] = time[0]
    for j in range(lates):
        for c in range(width):
            followed[0, j, c] = x[late[j], c]
    return Past(late, nodes, followed, np.zeros((1, lates, width)))


@compiled(inline="always")
def _begin(machine: Machine, x: np.ndarray) -> None:
    """Set states to their start; one may depend on the start of another."""
    tape, store, width = machine
    for _ in range(x.shape[0]):
        _load(machine, x)
        _run(machine, tape.codes.shape[0], width)
        for i in range(x.shape[0]):
            for c in range(width):
                x[i, c] = store[tape.starts[i], c]


@compiled(inline="always")
def _put(past: np.ndarray, node: int, defined: bool, mean: np.ndarray) -> None:
    """Put the mean of a step at a node of the past; zero if not `defined` yet."""
    for j in range(mean.shape[1]):
        for c in range(mean.shape[2]):
            past[node, j, c] = mean[0, j, c] if defined else 0.0


@compiled(inline="always")
def _at_sample(machine: Machine, room: Room, past: Past, time: np.ndarray, s: int) -> bool:
    """All values at a sample, states within their limits; whether the rates are still valid."""
    tape, store, width = machine
    x, late = room.x, past.late
    n, lates, moved = time.shape[0], past.late.shape[0], False
    for _ in range(2):
        _load(machine, x)
        _run(machine, tape.codes.shape[0], width)
        moved = False
        if lates and s < n - 1:
            # Until the step is done, the present value replaces its mean.
            past.nodes[s + 1] = 0.5 * (time[s] + time[s + 1])
            _put(past.followed, s + 1, False, past.mean)
            _aim(machine, late, 1.0, past.followed, s + 1)
        if lates and s > 0:
            _follow(machine, past, time[s], min(s + 2, n))
            for j in range(lates):
                slot = tape.states[late[j]]
                moved = moved or abs(store[slot, 0] - x[late[j], 0]) > 0.0
                for c in range(width):
                    x[late[j], c] = store[slot, c]
        moved = _confine(machine, store.shape[0], x) or moved
        if not moved:
            break
    return not moved and lates == 0


@compiled(inline="always")
def _is_end(p: int, pieces: int, stage: int, stages: int) -> bool:
    return (p == 0 and stage == 0) or (p == pieces - 1 and stage == stages - 1)


@compiled(inline="always")
def _to_stage(
    machine: Machine,
    given: Given,
    room: Room,
    past: Past,
    s: int,
    at: float,
    before: int,
    by: float,
) -> None:
    """Values at a stage, at the share `at` of the step from sample `s`: the rates of the stage
    `before` lead there, `by` so much time."""
    tape, store, width = machine
    now = given.time[s] + at * (given.time[s + 1] - given.time[s])
    for j in range(tape.inputs.shape[0]):
        store[tape.inputs[j], 0] = _given(given, j, s, at)
    for i in range(room.x.shape[0]):
        for c in range(width):
            store[tape.states[i], c] = room.x[i, c] + by * room.k[before, i, c]
    if tape.clock >= 0:
        store[tape.clock, 0] = now
    if past.late.shape[0]:
        _follow(machine, past, now, s + 2)


@compiled(inline="always")
def _piece(
    machine: Machine,
    given: Given,
    room: Room,
    past: Past,
    s: int,
    piece: tuple[int, int],
    stiff: bool,
    fresh: bool,
) -> tuple[float, float]:
    """One piece by Runge and Kutta's method (if `fresh`, its first rates are known), or if `stiff`
    by the implicit one, which gives the rate of the fastest mode and the error."""
    tape, store, width = machine
    x, k, late = room.x, room.k, past.late
    p, pieces = piece
    step = (given.time[s + 1] - given.time[s]) / pieces
    method, rate, error = (1 if stiff else 0), 0.0, 0.0
    for stage in range(STAGES[method]):
        at, by = (p + NODES[method, stage]) / pieces, NODES[method, stage] * step
        if stage > 0 or stiff or not fresh:
            _to_stage(machine, given, room, past, s, at, max(stage - 1, 0), by)
            _run(machine, tape.rated, store.shape[1] if stiff and stage == 0 else width)
        if late.shape[0] and _is_end(p, pieces, stage, STAGES[method]):
            _aim(machine, late, 0.5, past.mean, 0)
        for i in range(x.shape[0]):
            for c in range(width):
                before = 2.0 * stage * k[0, i, c] if stiff else 0.0
                k[stage, i, c] = 0.0 if tape.afters[i] >= 0 else store[tape.rates[i], c] - before
        if stiff:
            # The second stage leaves the slopes by the states as they are: the matrix is the same.
            rate = _linearised(machine, step, room.matrix)
            _solve(room.matrix, k[stage])
    for i in range(x.shape[0]):
        if stiff:
            apart = abs(0.5 * step * (k[0, i, 0] + k[1, i, 0]))
            error = max(error, apart / room.peak[i] if room.peak[i] > 0.0 else 0.0)
        for c in range(width):
            if stiff:
                x[i, c] += step * (1.5 * k[0, i, c] + 0.5 * k[1, i, c])
            else:
                for stage in range(STAGES[0]):
                    x[i, c] += step * WEIGHTS[stage] * k[stage, i, c]
    return rate, error


@compiled(inline="always")
def _copy(x: np.ndarray, to: np.ndarray) -> None:
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            to[i, c] = x[i, c]


@compiled(inline="always")
def _step(
    machine: Machine,
    given: Given,
    room: Room,
    past: Past,
    s: int,
    fresh: bool,
    stiff: bool,
    pieces: int,
) -> tuple[int, bool, int]:
    """From one sample to the next: explicitly in equal pieces, or implicitly in pieces of adaptive
    length, as inputs jump at a sample and the solution soon becomes smooth.

    Returns the number of steps taken, and the method and number of pieces to go on with.
    """
    tape, time = machine.tape, given.time
    x, k, peak, lates = room.x, room.k, room.peak, past.late.shape[0]
    length, taken, first = time[s + 1] - time[s], 0, 0
    for i in range(x.shape[0]):
        peak[i] = max(peak[i], abs(x[i, 0]))
    # Places and sizes of pieces in the finest ones.
    at, size = 0, FINEST // pieces
    rate, error, bent, growing = 0.0, 0.0, 0.0, False
    while at < FINEST:
        # States with a dead time follow the mean of a whole step.
        if at == 0 or (stiff and lates == 0):
            _copy(x, room.old)
        if lates and at == 0:
            _put(past.mean, 0, False, past.mean)
        pieces = FINEST // size
        step, again = length / pieces, False
        piece = (at // size, pieces)
        fastest, apart = _piece(machine, given, room, past, s, piece, stiff, fresh)
        if not stiff:
            fastest, there, turn, bend = _shown_by_stages(k, peak, step)
        rate = max(rate, fastest)
        fresh = False
        taken += 1
        # Fixed limits hold within a step too; moving ones are checked at the next sample.
        _confine(machine, tape.first + tape.begin, x)
        if stiff:
            error = apart
            again = error > ROUGH and size > 1
            longer = 2 * size if error < ROUGH / 8.0 and size < FINEST // PIECES else size
            if again:
                size //= 2
                at = 0 if lates else at
                first = first if at else 0
            else:
                at += size
                first = longer if first == 0 else first
                size = longer if at % longer == 0 and lates == 0 else size
        else:
            at += size
            bent = max(bent, bend)
            growing = growing or (turn > 0.0 and rate * step > LIVELY)
            # A mode with z = rate * step bends by z**2/4 of it in half a step; the error is
            # z**5/120 of it.
            error = max(error, (rate * step) ** 3 / 30.0 * there)
            if at == FINEST:
                again, stiff, pieces = _next_pieces(
                    pieces, rate * step > LIVELY, error, bent, growing
                )
            if again:
                at, size = 0, FINEST // pieces
                rate, error, bent, growing = 0.0, 0.0, 0.0, False
        if again:
            _copy(room.old, x)
    if stiff:
        stiff = rate * length > 0.5 * LIVELY * PIECES
        pieces = FINEST // first if stiff else PIECES
    elif rate * step < 0.4 * LIVELY and error < EXACT / 50.0 and pieces > 1:
        pieces //= 2
    if lates:
        _put(past.followed, s + 1, True, past.mean)
    return taken, stiff, pieces


@compiled(inline="always")
def _ran_away(x: np.ndarray) -> bool:
    for i in range(x.shape[0]):
        for c in range(x.shape[1]):
            if not abs(x[i, c]) < HUGE:
                return True
    return False


@compiled(  # type: ignore[untyped-decorator] # numba tells no type of such an option
    cache=CACHED, nogil=True, fastmath=False, error_model="numpy", **UNCOUNTED
)
def _over_samples(
    machine: Machine,
    given: Given,
    outputs: np.ndarray,
    states: np.ndarray,
    room: Room,
    past: Past,
) -> int:
    """From sample to sample; returns what `integrate` does.

    Reference counting of arrays, at every line that passes one on, takes longer than a step.
    """
    tape, store, width = machine
    n, taken, pieces, stiff = given.time.shape[0], 0, 1, False
    for s in range(n):
        for j in range(tape.inputs.shape[0]):
            store[tape.inputs[j], 0] = given.inputs[s, j]
        if tape.clock >= 0:
            store[tape.clock, 0] = given.time[s]
        fresh = _at_sample(machine, room, past, given.time, s)
        for i in range(room.x.shape[0]):
            states[s, i] = room.x[i, 0]
        for j in range(tape.outputs.shape[0]):
            for c in range(width):
                outputs[s, j, c] = store[tape.outputs[j], c]
        if s == n - 1:
            break
        steps, stiff, pieces = _step(machine, given, room, past, s, fresh, stiff, pieces)
        taken += steps
        if _ran_away(room.x):
            return -1
    return taken


@compiled(cache=CACHED, nogil=True, fastmath=False, error_model="numpy")
def integrate(
    tape: Tape,
    held: np.ndarray,
    time: np.ndarray,
    inputs: np.ndarray,
    store: np.ndarray,
    outputs: np.ndarray,
    states: np.ndarray,
) -> int:
    """Integrate over all samples; the number of steps taken, or -1 where a number ran away.

    Parameters
    ----------
    held : per input, whether it keeps its value until the next sample; others are interpolated.
    inputs : shape (n, inputs).
    store : shape (values of the plan, width + states), columns as in `Machine`; filled in for
        parameters, constants and what follows from them alone (operations before `tape.begin`).
    outputs, states : filled, shapes (n, outputs, width), and (n, states) without slopes.
    """
    width = outputs.shape[2]
    room = _room(states.shape[1], width)
    for i in range(states.shape[1]):
        store[tape.states[i], width + i] = 1.0
    for j in range(tape.inputs.shape[0]):
        store[tape.inputs[j], 0] = inputs[0, j]
    if tape.clock >= 0:
        store[tape.clock, 0] = time[0]
    machine, given = Machine(tape, store, width), Given(held, time, inputs)
    _begin(machine, room.x)
    past = _past(tape, time, room.x)
    return int(_over_samples(machine, given, outputs, states, room, past))
