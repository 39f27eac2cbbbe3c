"""Judge plant-days on a cluster of dask.distributed: one that is there, or one of this machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from importlib import import_module
from typing import Any

from rulec_runtime.fleet.plant_day import Row, judge_day
from rulec_runtime.fleet.task import Task
from rulec_runtime.output.refusal import Refusal

from rulec.fleet.failed import died
from rulec.limits import FLEET_AHEAD, FLEET_CONNECT, FLEET_DEATHS


def run(
    tasks: Sequence[Task], rulesets: Mapping[str, str], jobs: int, scheduler: str | None
) -> Iterator[tuple[Task, Row]]:
    """Judge on the cluster of a scheduler, or with so many processes of this machine.

    Results come as they are done. Where a worker dies, the scheduler has what it had in work done
    by another one; a plant-day at which workers died again and again becomes a row that says so.
    """
    try:
        dask: Any = import_module("dask")
        distributed: Any = import_module("distributed")
    except ModuleNotFoundError:
        raise Refusal("--engine dask needs dask.distributed: pip install 'rulec[fleet]'") from None
    settings = {
        "distributed.scheduler.allowed-failures": FLEET_DEATHS - 1,
        "distributed.worker.daemon": True,
    }
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(settings))
        client = _client(distributed, jobs, scheduler, stack)
        # Tasks, and no data that is scattered: what died with a worker is made again.
        texts = {
            name: client.submit(str, text, key=f"ruleset-{name}") for name, text in rulesets.items()
        }
        waiting = list(reversed(tasks))
        work: dict[str, Task] = {}

        def next_one() -> Any:
            task = waiting.pop()
            name = f"{task.plant}-{task.day}-{task.key}"
            work[name] = task
            return client.submit(judge_day, task, texts[task.ruleset], key=name, pure=False)

        workers = max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
        ahead = min(len(waiting), FLEET_AHEAD * workers)
        coming = distributed.as_completed([next_one() for _ in range(ahead)])
        for future in coming:
            task = work.pop(future.key)
            yield task, _result(distributed, future, task)
            if waiting:
                coming.add(next_one())


def _result(distributed: Any, future: Any, task: Task) -> Row:
    try:
        row: Row = future.result()
    except distributed.KilledWorker:
        return died(task)
    except ModuleNotFoundError as error:
        raise Refusal(
            f"workers of the cluster lack {error.name}; install rulec-runtime there, of the same "
            "version as here"
        ) from None
    return row


def _client(distributed: Any, jobs: int, scheduler: str | None, stack: ExitStack) -> Any:
    if scheduler is not None:
        try:
            return stack.enter_context(distributed.Client(scheduler, timeout=FLEET_CONNECT))
        except (OSError, TimeoutError, ValueError) as error:
            raise Refusal(
                f"{scheduler}: no scheduler of dask answers there ({error or 'no answer'})"
            ) from None
    cluster = stack.enter_context(
        distributed.LocalCluster(
            n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
    )
    return stack.enter_context(distributed.Client(cluster))
