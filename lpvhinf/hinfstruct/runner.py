"""Runs the work of many starts here or in processes, shares the time, and ends in good order when interrupted."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from lpvhinf.checks import Array
from lpvhinf.errors import SynthesisError
from lpvhinf.hinfstruct import runs
from lpvhinf.hinfstruct.runs import Outcome, Task
from lpvhinf.progress import Progress

#: Part of the time left that a start may take at least.
LEAST = 0.15

Checkpoint = Callable[[Array, float], None]


class Runner:
    """Runs tasks in the order given, and keeps the best point for the listeners and for an interruption.

    Attributes
    ----------
    best, theta : float, array or None
        The smallest norm heard of (by tracked peaks), and its parameters.
    interrupted : bool
        An interruption (Ctrl-C) has been met; no more work is begun then.
    """

    def __init__(self, progress: Progress, checkpoint: Checkpoint | None, jobs: int, deadline: float) -> None:
        self.progress, self.checkpoint, self.jobs, self.deadline = progress, checkpoint, jobs, deadline
        self.best = np.inf
        self.theta: Array | None = None
        self.interrupted = False
        self.iteration = 0
        self._pool: ProcessPoolExecutor | None = None
        self._stop: Any = None

    def __enter__(self) -> Runner:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._stop.set()
            self._pool.shutdown(cancel_futures=True)

    @property
    def over(self) -> bool:
        """True if no more work is to begin."""
        return self.interrupted or time.monotonic() >= self.deadline

    def map(self, work: Callable[..., Outcome], tasks: list[Task], share: float) -> list[Outcome]:
        """Outcomes in the order of the tasks; all tasks together take at most `share` of the time left.

        Fewer than the tasks if interrupted.
        """
        if not tasks or self.interrupted:
            return []
        end = time.monotonic() + share * (self.deadline - time.monotonic()) if np.isfinite(self.deadline) else np.inf
        if self.jobs > 1 and len(tasks) > 1:
            return self._in_processes(work, tasks, end)
        out: list[Outcome] = []
        for k, task in enumerate(tasks):
            self.progress.stage(f"{work.__name__} {k + 1} of {len(tasks)} (start {task.start})")
            try:
                out.append(work(_limited(task, end, len(tasks) - k), self.hear))
            except KeyboardInterrupt:
                self.interrupted = True
                break
        return out

    def _in_processes(self, work: Callable[..., Outcome], tasks: list[Task], end: float) -> list[Outcome]:
        self.progress.stage(f"{work.__name__}, {len(tasks)} starts in {self.jobs} processes", len(tasks))
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._stop = context.Event()
            self._pool = ProcessPoolExecutor(
                self.jobs, mp_context=context, initializer=_prepare, initargs=(self._stop,)
            )
        waves = -(-len(tasks) // self.jobs)
        futures = [self._pool.submit(work, _limited(task, end, waves)) for task in tasks]
        out: list[Outcome] = []
        for future in futures:
            try:
                outcome = future.result()
            except BrokenProcessPool as error:
                raise SynthesisError(
                    f"jobs is {self.jobs}, but a worker process ended before its work was done. In a script call this "
                    'under `if __name__ == "__main__":`, as workers import the script anew; else it was killed, '
                    "perhaps for lack of memory: pass jobs=1."
                ) from error
            except KeyboardInterrupt:
                # the workers see the event at their next evaluation, and hand back what they have
                self.interrupted = True
                self._stop.set()
                outcome = future.result()
            out.append(outcome)
            self.hear("", outcome.theta, outcome.gamma)
        return out

    def hear(self, phase: str, theta: Array, value: float) -> None:
        """Pass on the norm (while stabilising: the abscissa) at theta; a better point goes to the checkpoint."""
        self.iteration += 1
        if phase == "stabilise":
            self.progress.update(1, abscissa=value, iteration=self.iteration)
            return
        if value < self.best:
            self.best, self.theta = value, theta.copy()
            if self.checkpoint is not None:
                self.checkpoint(theta.copy(), value)
        self.progress.update(1, gamma=self.best, iteration=self.iteration)


def _limited(task: Task, end: float, parts: int) -> Task:
    # many starts in little time: rather some that get somewhere than all of them cut short
    return replace(task, seconds=max(0.0, (end - time.monotonic()) * max(1.0 / parts, LEAST)))


def _prepare(stop: Any) -> None:
    # the interruption of a terminal reaches all processes; the caller's process decides what to do
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threadpool_limits(limits=1)
    runs.stopped = stop.is_set
