"""One solve in a process of its own, which can be stopped and whose memory is its own: writes a line of JSON."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from typing import Any

from benchmarks.lpv.cases import OURS, Size, inequalities
from lpvhinf.errors import LpvHinfError
from lpvhinf.lpv.solve_lmi import solve_lmi

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Seconds for starting the process, beyond the limit of the solver.
GRACE = 20.0


def solved(size: Size, solver: str, gap: float, time_limit: float) -> dict[str, Any]:
    """gamma, its bound, the recomputed margin, seconds and memory of one solve in this process."""
    problem = inequalities(size).problem
    if solver != OURS:
        import cvxpy  # noqa: F401 - its loading is not timed
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began, used = time.perf_counter(), time.process_time()
    try:
        solution = solve_lmi(problem, solver=solver, gap=gap, time_limit=time_limit)
    except LpvHinfError as error:
        return {"status": f"{type(error).__name__}: {error}"}
    wall, cpu = time.perf_counter() - began, time.process_time() - used
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "status": f"{solution.status}: {solution.message}",
        "gamma": solution.gamma,
        "gamma_lower": solution.gamma_lower,
        "margin": min(float(values.min()) for values in solution.eigenvalues.values()),
        "iterations": solution.iterations,
        "wall": wall,
        "cpu": cpu,
        "memory": (after - before) / 1024.0,
    }


def in_a_process(size: Size, solver: str, gap: float, time_limit: float) -> dict[str, Any]:
    """The same in a new process; one that does not end in time is stopped."""
    given = json.dumps([size.n_x, size.n_grid, size.n_basis, solver, gap, time_limit])
    command = [sys.executable, "-m", "benchmarks.lpv.worker", given]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=time_limit + GRACE,
            check=False,
            env={**os.environ, **ONE_THREAD},
        )
    except subprocess.TimeoutExpired:
        return {"status": f"stopped after {time_limit:g} s"}
    if done.returncode:
        return {"status": f"failed: {(done.stderr.strip().splitlines() or ['no message'])[-1]}"}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


if __name__ == "__main__":
    n_x, n_grid, n_basis, name, wanted, limit = json.loads(sys.argv[1])
    found_here = solved(Size(n_x=n_x, n_grid=n_grid, n_basis=n_basis), name, wanted, limit)
    sys.stdout.write(json.dumps(found_here) + "\n")
