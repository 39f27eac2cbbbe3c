"""Work on a cluster of dask.distributed: an existing one, or one on this machine."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from importlib import import_module
from typing import Any, TypeVar

from rulec_runtime.output.refusal import Refusal, to_install

from rulec.engines.call import Call, Engine
from rulec.limits import SCHEDULER_CONNECT, WORKER_DEATHS

B = TypeVar("B")


def run(
    work: Callable[..., B],
    calls: Sequence[Call],
    shared: Mapping[str, str | bytes],
    engine: Engine,
    died: Callable[[int], B],
) -> Iterator[tuple[int, B]]:
    """Do all calls on the cluster of a scheduler, or with processes of this machine.

    If a worker dies, the scheduler gives its work to another one.
    """
    try:
        dask: Any = import_module("dask")
        distributed: Any = import_module("distributed")
    except ModuleNotFoundError:
        raise Refusal(
            f"--engine dask needs dask.distributed: {to_install('fleet', 'rulec')}"
        ) from None
    settings = {
        "distributed.scheduler.allowed-failures": WORKER_DEATHS - 1,
        "distributed.worker.daemon": True,
    }
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(settings))
        client = _client(distributed, engine, stack)
        # Tasks and not scattered data, as the scheduler repeats tasks that a dead worker lost.
        there = {name: client.submit(type(value), value) for name, value in shared.items()}
        numbers = {}
        for number, call in enumerate(calls):
            more = () if call.shared is None else (there[call.shared],)
            numbers[client.submit(work, *call.words, *more, pure=False)] = number
        for future in distributed.as_completed(list(numbers)):
            yield numbers[future], _result(distributed, future, numbers[future], died)
            future.release()  # so that workers do not keep what is done


def _result(distributed: Any, future: Any, number: int, died: Callable[[int], B]) -> B:
    try:
        result: B = future.result()
    except distributed.KilledWorker:
        return died(number)
    except ModuleNotFoundError as error:
        raise Refusal(
            f"workers of the cluster lack {error.name}; install there what is installed here, of "
            "the same version"
        ) from None
    return result


def _client(distributed: Any, engine: Engine, stack: ExitStack) -> Any:
    address = engine.scheduler
    if address is not None:
        try:
            return stack.enter_context(distributed.Client(address, timeout=SCHEDULER_CONNECT))
        except (OSError, TimeoutError, ValueError) as error:
            raise Refusal(
                f"{address}: no scheduler of dask answers there ({error or 'no answer'})"
            ) from None
    cluster = stack.enter_context(
        distributed.LocalCluster(
            n_workers=engine.jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50
        )
    )
    return stack.enter_context(distributed.Client(cluster))
