"""``python -m benchmarks.hinfstruct [SYSTEM ...] [--seeds N] [--data DIR] [--out DIR]``.

Static output feedback for the COMPleib systems, and dynamic for a few. Every run is written at once: a call that was
stopped goes on where it ended. Delete the CSV to begin anew.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

# Before NumPy is imported: CPU seconds are those of one thread.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from benchmarks.hinfstruct.problems import load, problems, solve
from benchmarks.hinfstruct.report import read_runs, write_results
from benchmarks.runner import environment

DATA = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "compleib"


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing, system by system and seed by seed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hinfstruct", description=__doc__)
    parser.add_argument("systems", nargs="*", metavar="SYSTEM", help="names of systems; all if left out")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds, from 0 (default %(default)s)")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the systems (default %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks"), help="folder (default %(default)s)")
    arguments = parser.parse_args(argv)
    if arguments.seeds < 1:
        parser.error(f"--seeds is {arguments.seeds}, wanted at least 1")
    if not (arguments.data / "reference.json").exists():
        print(f"skipped: the COMPleib systems are not in {arguments.data}; name their folder by --data")
        return 0
    known = problems(arguments.data)
    unknown = sorted(set(arguments.systems) - {problem.name for problem in known})
    if unknown:
        parser.error(f"unknown system {', '.join(unknown)}; known: {', '.join(p.name for p in known if not p.order)}")
    chosen = [problem for problem in known if not arguments.systems or problem.name in arguments.systems]
    runs = read_runs(arguments.out / "hinfstruct.csv")
    done = {(run.name, run.order, run.seed) for run in runs}
    where = environment()
    for seed in range(arguments.seeds):
        for problem in chosen:
            if (problem.name, problem.order, seed) in done:
                continue
            run = solve(load(arguments.data, problem.name), problem, seed)
            runs.append(run)
            write_results(arguments.out, runs, where)
            print(
                f"{run.name:6} order {run.order} seed {seed}: gamma {run.gamma:.6g}, ratio {run.ratio:.4f}, "
                f"{run.cpu:.1f} s",
                flush=True,
            )
    print(f"written: {arguments.out / 'hinfstruct.md'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
