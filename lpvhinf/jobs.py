"""Run independent jobs over processes, with their progress told here."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from typing import Any, TypeVar

from lpvhinf.progress import Progress

R = TypeVar("R")


class NamedProgress(Progress):
    """Tells a listener in the same process which job a message comes from."""

    def __init__(self, name: str, listener: Progress) -> None:
        self.name, self.listener = name, listener

    def stage(self, name: str, total: int | None = None) -> None:
        """Pass on a stage."""
        self.listener.stage(f"{self.name}: {name}", total)

    def update(self, advance: int = 1, **values: float) -> None:
        """Pass on steps."""
        self.listener.update(advance, **values)

    def log(self, message: str) -> None:
        """Pass on a message."""
        self.listener.log(f"{self.name}: {message}")


class QueuedProgress(Progress):
    """Sends a job's stages and messages to the process that waits; single steps would flood it."""

    def __init__(self, name: str, channel: Any) -> None:
        self.name, self.channel = name, channel

    def stage(self, name: str, total: int | None = None) -> None:
        """Pass on a stage."""
        self.channel.put(("stage", f"{self.name}: {name}"))

    def log(self, message: str) -> None:
        """Pass on a message."""
        self.channel.put(("log", f"{self.name}: {message}"))


def run_jobs(
    work: Callable[..., R], tasks: Sequence[tuple[str, tuple[Any, ...]]], *, jobs: int, progress: Progress
) -> list[R]:
    """work(*arguments, progress) for every (name, arguments), in order; over `jobs` processes if above one."""
    if jobs == 1 or len(tasks) <= 1:
        return [work(*arguments, NamedProgress(name, progress)) for name, arguments in tasks]
    # every worker keeps to one thread: set before NumPy is loaded there
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    with context.Manager() as manager, ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=context) as pool:
        channel = manager.Queue()
        futures: list[Future[R]] = [
            pool.submit(work, *arguments, QueuedProgress(name, channel)) for name, arguments in tasks
        ]
        try:
            waiting = set(futures)
            while waiting:
                done, waiting = wait(waiting, timeout=0.5)
                _forward(channel, progress)
                for future in done:
                    future.result()  # an error of a job ends the run at once; finished jobs are on disk
        except BaseException:
            # nobody waits for the others any more: they have checkpoints, and would otherwise go on for minutes
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            raise
        _forward(channel, progress)
        return [future.result() for future in futures]


def _forward(channel: Any, progress: Progress) -> None:
    while True:
        try:
            kind, message = channel.get_nowait()
        except queue.Empty:
            return
        (progress.log if kind == "log" else progress.stage)(message)
