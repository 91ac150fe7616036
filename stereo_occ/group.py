"""Several processes that train one model together: how they start, and what they tell each other.

They are started here, by torchrun, or by Slurm; a process that was started by one of the latter finds its place in the
environment.

Programs that do not train come here as well; lightning, which takes seconds to import, is imported where it is needed.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable
from typing import Any, TypeVar

import torch
import torch.distributed as dist
from torch.multiprocessing.spawn import ProcessExitedException, spawn

from stereo_occ.errors import UserError

T = TypeVar("T")


def place() -> tuple[int, int]:
    """Which process of the group this is, from 0, and how many there are; ``(0, 1)`` where there is no group."""
    if dist.is_available() and dist.is_initialized():
        return dist.get_rank(), dist.get_world_size()
    return 0, 1


def gathered(value: T) -> list[T]:
    """The values of all processes, in their order, in each of them."""
    _, processes = place()
    if processes == 1:
        return [value]
    values: list[Any] = [None] * processes
    dist.all_gather_object(values, value)
    return values


@torch.no_grad()
def share_buffers(module: torch.nn.Module) -> None:
    """Give all processes the first one's buffers: the statistics of batch norm differ after a step."""
    if place()[1] > 1:
        for buffer in module.buffers():
            dist.broadcast(buffer, 0)


def is_first() -> bool:
    """Whether this process is the first of its group or alone, known before the group has met."""
    rank = next(
        (os.environ[name] for name in ("RANK", "SLURM_PROCID", "LOCAL_RANK") if name in os.environ), "0"
    )
    return not started_elsewhere() or rank == "0"


def started_elsewhere() -> bool:
    """Whether something has started all processes of the group, this one among them."""
    return "LOCAL_RANK" in os.environ or (os.environ.get("SLURM_NTASKS", "1") != "1" and _is_slurm_task())


def _is_slurm_task() -> bool:
    from lightning.fabric.plugins.environments.slurm import SLURMEnvironment

    return SLURMEnvironment.detect()


def run_in_processes(processes: int, function: Callable[..., object], *arguments: Any) -> None:
    """Call ``function(*arguments)`` in that many new processes of this machine, and wait for all.

    Raises:
        UserError: as one of them did.
        SystemExit: with the code of the first that ended otherwise than well.
    """
    from lightning.fabric.plugins.environments.lightning import find_free_network_port

    problems = multiprocessing.get_context("spawn").SimpleQueue()
    port = find_free_network_port()
    group = spawn(_member, (processes, port, problems, function, arguments), processes, join=False)
    former = signal.signal(signal.SIGTERM, lambda *_: [process.terminate() for process in group.processes])
    try:
        while not group.join():
            pass
    except ProcessExitedException as error:
        if not problems.empty():
            raise UserError(problems.get()) from error
        raise SystemExit(error.exit_code) from error
    finally:
        signal.signal(signal.SIGTERM, former)


def _member(
    rank: int,
    processes: int,
    port: int,
    problems: Any,
    function: Callable[..., object],
    arguments: tuple[Any, ...],
) -> None:
    os.environ |= {
        "RANK": str(rank),
        "LOCAL_RANK": str(rank),
        "WORLD_SIZE": str(processes),
        "MASTER_ADDR": "127.0.0.1",
        "MASTER_PORT": str(port),
    }
    try:
        function(*arguments)
    except UserError as error:
        problems.put(str(error))
        raise SystemExit(2) from error
