"""``python -m benchmarks [NAME ...] [--samples N] [--out DIR]``: time, and write results.csv and report.md."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

# Before NumPy is imported: threads would blur the ratios.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from benchmarks import hinf_norm, sampling
from benchmarks.runner import environment, run, write_results

REGISTERED = {module.BENCHMARK.name: module.BENCHMARK for module in (sampling, hinf_norm)}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the named benchmarks, or all of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(REGISTERED)}; all if left out")
    parser.add_argument("--samples", type=int, default=7, help="pairs of times a case (default %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks"), help="folder (default %(default)s)")
    arguments = parser.parse_args(argv)
    unknown = [name for name in arguments.names if name not in REGISTERED]
    if unknown:
        parser.error(f"unknown benchmark {', '.join(unknown)}; known: {', '.join(REGISTERED)}")
    if arguments.samples < 1:
        parser.error(f"--samples is {arguments.samples}, wanted at least 1")
    chosen = [REGISTERED[name] for name in arguments.names or REGISTERED]
    timings = []
    for timing in run(chosen, samples=arguments.samples):
        timings.append(timing)
        print(f"{timing.benchmark:12} {timing.size:42} {timing.ratio:8.3g} x", flush=True)
    write_results(arguments.out, chosen, timings, environment())
    print(f"written: {arguments.out / 'report.md'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
