"""Do work in processes of this machine, or on a cluster of dask.distributed."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NoReturn, TypeVar

from rulec_runtime.output.refusal import Misused, Refusal

from rulec.engines.call import DASK, ENGINES, LOCAL, Call, Engine
from rulec.limits import WORKER_DEATHS

B = TypeVar("B")


def chosen(kind: str = LOCAL, jobs: int | None = None, scheduler: str | None = None) -> Engine:
    """The requested engine; by default with a process per core.

    Raises `Misused` for arguments that make no sense.
    """
    if kind not in ENGINES:
        raise Misused(f"--engine {kind}: give one of {', '.join(ENGINES)}")
    if jobs is not None and jobs < 1:
        raise Misused(f"--jobs {jobs}: give 1 or more")
    if scheduler is not None and kind != DASK:
        raise Misused("--scheduler is an address for --engine dask")
    return Engine(kind=kind, jobs=jobs or os.cpu_count() or 1, scheduler=scheduler)


def given_up(_: int) -> NoReturn:
    """Refuse to go on without a piece of work."""
    raise Refusal(f"{WORKER_DEATHS} processes died at the same work; is there enough memory?")


def run(
    engine: Engine,
    work: Callable[..., B],
    calls: Sequence[Call],
    shared: Mapping[str, str | bytes] | None = None,
    died: Callable[[int], B] = given_up,
) -> Iterator[tuple[int, B]]:
    """Do all calls; yields number and result of each as it is done, in any order.

    If a process dies, another one takes over its work. If processes die repeatedly at a call, its
    result is that of `died`. An exception in a call ends the run, and so does an interrupt; no
    process is left behind.
    """
    if engine.kind == DASK:
        from rulec.engines import dask_engine

        return dask_engine.run(work, calls, shared or {}, engine, died)
    from rulec.engines import local

    return local.run(work, calls, shared or {}, engine.jobs, died)


def in_order(
    engine: Engine,
    work: Callable[..., B],
    calls: Sequence[Call],
    shared: Mapping[str, str | bytes] | None = None,
    done: Callable[[B], None] = lambda _: None,
) -> list[B]:
    """Results in the order of the calls; `done` is called with each as it arrives."""
    found: dict[int, B] = {}
    for number, result in run(engine, work, calls, shared):
        found[number] = result
        done(result)
    return [found[number] for number in range(len(calls))]
