"""``python -m benchmarks.hinfstruct [SYSTEM ...] [--part PART] [--seeds N] [--jobs N] [--tiny] [--out DIR]``.

Three parts: static output feedback for the COMPleib systems, and dynamic for a few; co-designs of the planar actuator;
synthetic problems that grow. Every run is written at once: a call that was stopped goes on where it ended. Delete the
CSV file of a part to begin it anew.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

# Before NumPy is imported, here and in every process: CPU seconds are those of one thread.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from benchmarks.hinfstruct import actuator, compleib, scaling
from benchmarks.hinfstruct.report import files, write_report
from benchmarks.hinfstruct.store import Row, append, read_rows
from benchmarks.runner import environment

DATA = Path(__file__).resolve().parents[3] / "shared" / "anchors" / "compleib"
PARTS = ("compleib", "mmpa", "scaling")


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing, part by part, and write the report."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hinfstruct", description=__doc__)
    parser.add_argument("systems", nargs="*", metavar="SYSTEM", help="systems of COMPleib, and no other part; all")
    parser.add_argument("--part", choices=PARTS, action="append", help="what to run, may be repeated; all if left out")
    parser.add_argument("--seeds", type=int, default=10, help="seeds of COMPleib, from 0 (default %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="processes of the other parts (default %(default)s)")
    parser.add_argument("--tiny", action="store_true", help="coarse and small mmpa and scaling, to try the command")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the systems (default %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/benchmarks"), help="folder (default %(default)s)")
    given = parser.parse_args(argv)
    for name in ("seeds", "jobs"):
        if getattr(given, name) < 1:
            parser.error(f"--{name} is {getattr(given, name)}, wanted at least 1")
    if given.systems and given.part not in (None, ["compleib"]):
        parser.error(f"systems {', '.join(given.systems)} are given, wanted --part compleib alone with them")
    parts = ["compleib"] if given.systems else given.part or PARTS
    path, where = files(given.out), environment()

    def run(part: str, kind: type, cases: Sequence[Any], solve: Callable[[Any], Any]) -> None:
        earlier: list[Row[Any]] = read_rows(path[part], kind)
        done = {row.run.key for row in earlier}
        for case in cases:
            if case.key not in done:
                found = solve(case)
                append(path[part], found, where)
                write_report(given.out)
                print(found, flush=True)

    if "compleib" in parts and not (given.data / "reference.json").exists():
        print(f"skipped: the COMPleib systems are not in {given.data}; name their folder by --data")
    elif "compleib" in parts:
        known = compleib.problems(given.data, range(given.seeds))
        names = list(dict.fromkeys(problem.name for problem in known))
        if unknown := sorted(set(given.systems) - set(names)):
            parser.error(f"unknown system {', '.join(unknown)}; known: {', '.join(names)}")
        chosen = [problem for problem in known if not given.systems or problem.name in given.systems]
        run("compleib", compleib.CompleibRun, chosen, lambda p: compleib.solve(compleib.load(given.data, p.name), p))
    if "mmpa" in parts:
        cases = actuator.cases(actuator.TINY if given.tiny else actuator.FULL)
        run("mmpa", actuator.ActuatorRun, cases, lambda case: actuator.solve(case, jobs=given.jobs))
    if "scaling" in parts:
        sizes = scaling.TINY if given.tiny else scaling.SIZES
        options = scaling.TINY_OPTIONS if given.tiny else {}
        run("scaling", scaling.ScalingRun, sizes, lambda size: scaling.solve(size, jobs=given.jobs, **options))
    print(f"written: {write_report(given.out)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
