"""What a run is judged by: seconds, those of its processes included, and norms that another program computes."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterable

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct import hinf_norm

Loop = tuple[Array, Array, Array, Array]


class Stopwatch:
    """Wall and CPU seconds since it was made."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), cpu_seconds()

    def read(self) -> tuple[float, float]:
        """(wall, CPU) seconds so far."""
        return time.perf_counter() - self._wall, cpu_seconds() - self._cpu


def cpu_seconds() -> float:
    """CPU seconds of this process and of all child processes that have ended and were waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def finished(interrupted: bool) -> None:
    """End the benchmark where a run was interrupted (Ctrl-C): its result, the best so far, is not one to record."""
    if interrupted:
        raise KeyboardInterrupt


def independent_norm(loop: Loop) -> float:
    """The norm by SLICOT's AB13DD alone; by the package's own iteration where slycot is missing."""
    A, B, C, D = loop
    try:
        import slycot
    except ImportError:
        return hinf_norm(A, B, C, D).norm
    n = A.shape[0]
    return float(slycot.ab13dd("C", "I", "N", "D", n, B.shape[1], C.shape[0], A, np.eye(n), B, C, D, 1e-10)[0])


def slicot_ratio(loops: Iterable[Loop], gammas: Iterable[float]) -> float:
    """Norm by SLICOT over the norm reported, of the loop where it is farthest from one."""
    ratios = [independent_norm(loop) / gamma for loop, gamma in zip(loops, gammas, strict=True)]
    return max(ratios, key=lambda ratio: abs(ratio - 1.0))
