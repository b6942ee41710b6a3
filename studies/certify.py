"""Certificates of the designs of other studies: proved for every position, saved, and checked again from the files.

python -m studies.certify --from results/output_observer --from ... [--preset quick|full|FILE.toml] [--out DIR]

Claims about every finished design, each of which ends as a folder with its certificate:

* frozen: every frozen closed loop is stable;
* rate-v: the closed loop is stable for all p(t) with speeds up to v on every axis;
* fastest: the largest such speed that is proved;
* quadratic: the largest part of P, about its centre, over which one Lyapunov matrix is proved;
* gain: a bound of the weighted loop's H-infinity norm at every frozen position, beside the largest norm found.

The claims are about the stored loops, which are polynomials in p. The report states the error of the plant's fit.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import lpvhinf
from lpvhinf.checks import finite_array, positive, whole_number
from lpvhinf.cli.exit_status import exit_status
from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.errors import DomainError, StorageError
from lpvhinf.jobs import run_jobs
from lpvhinf.progress import Progress
from lpvhinf.storage import make_folder, read_json, write_json
from studies.certify_claims import CERTIFICATE, carry_out
from studies.certify_report import write_report
from studies.plant_results import finished, save
from studies.record import run_record
from studies.results import belongs
from studies.settings import fingerprint, load_settings

__all__ = ["NAME", "Job", "Settings", "jobs_of", "main", "run", "run_claim", "write_report"]

NAME = "certify"
KINDS = ("frozen", "rate", "fastest", "quadratic", "gain")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the study; see the presets for their meaning."""

    sources: tuple[str, ...]
    designs: tuple[str, ...]
    claims: tuple[str, ...]
    rates: tuple[float, ...]
    fastest: tuple[float, ...]
    fastest_steps: int
    box_steps: int
    gain_factor: float
    gain_steps: int
    gain_grid: int
    time_limit: float
    seed: int = 0
    jobs: int = 1

    def __post_init__(self) -> None:
        for name in ("sources", "designs", "claims"):
            value = getattr(self, name)
            if not isinstance(value, tuple) or not all(isinstance(item, str) for item in value):
                raise DomainError(f"{name} is {value!r}, wanted a list of words.")
        names = [Path(source).name for source in self.sources]
        if not names or len(set(names)) < len(names):
            raise DomainError(f"sources is {list(self.sources)}, wanted results folders with different names.")
        unknown = set(self.claims) - set(KINDS)
        if unknown or not self.claims:
            raise DomainError(f"claims is {list(self.claims)}, wanted some of {', '.join(KINDS)}.")
        for name in ("rates", "fastest"):
            if np.min(finite_array(name, getattr(self, name), (None,)), initial=np.inf) <= 0.0:
                raise DomainError(f"{name} is {getattr(self, name)}, wanted speeds above 0.")
        if len(self.fastest) != 2 or self.fastest[0] >= self.fastest[1]:
            raise DomainError(f"fastest is {self.fastest}, wanted the lowest and the highest speed to look between.")
        if positive("gain_factor", self.gain_factor) <= 1.0:
            raise DomainError(f"gain_factor is {self.gain_factor}, wanted above 1: it multiplies a norm that is found.")
        positive("time_limit", self.time_limit, "s")
        for name, least in (("fastest_steps", 0), ("box_steps", 0), ("gain_steps", 0), ("seed", 0)):
            whole_number(name, getattr(self, name), least)
        for name, least in (("gain_grid", 2), ("jobs", 1)):
            whole_number(name, getattr(self, name), least)


@dataclass(frozen=True, kw_only=True)
class Job:
    """One claim about one design; `rate` for the claims of rates only."""

    source: str
    design: str
    kind: str
    rate: float | None = None

    @property
    def name(self) -> str:
        """Of the folder."""
        claim = self.kind if self.rate is None else f"{self.kind}-{self.rate:g}"
        return f"{Path(self.source).name}/{self.design}/{claim}"

    @property
    def folder(self) -> Path:
        """Of the design."""
        return Path(self.source) / "designs" / self.design

    @property
    def loop(self) -> Path:
        """The system that the claim is about."""
        return self.folder / ("performance_loop.npz" if self.kind == "gain" else "closed_loop.npz")


def designs_of(source: str) -> tuple[list[str], list[str]]:
    """Finished and unfinished designs of a results folder.

    Raises
    ------
    DomainError
        If there is no such results folder, or it is of a study without designs.
    """
    folder = Path(source)
    if not (folder / "designs.json").is_file():
        raise DomainError(
            f"sources names {source}, which holds no designs.json. Run the study of its designs first, for example "
            "python -m studies run output_observer, or name another results folder."
        )
    done, missing = list[str](), list[str]()
    for name, key in read_json(folder / "designs.json").items():
        try:
            ready = belongs(read_json(folder / "designs" / name / "summary.json"), key)
        except StorageError:
            ready = False
        (done if ready else missing).append(name)
    return done, missing


def jobs_of(settings: Settings) -> tuple[list[Job], list[str]]:
    """The claims, and the designs that are not finished; the quick claims about all designs come first.

    Raises
    ------
    DomainError
        If a source has no finished designs, or a design that is asked for is not among them.
    """
    found, missing = list[tuple[str, str]](), list[str]()
    for source in settings.sources:
        done, waiting = designs_of(source)
        if not done:
            raise DomainError(f"sources names {source}, in which no design is finished. Finish its study first.")
        found += [(source, name) for name in done if not settings.designs or name in settings.designs]
        missing += [f"{Path(source).name}/{n}" for n in waiting if not settings.designs or n in settings.designs]
    unknown = set(settings.designs) - {name for _, name in found} - {name.partition("/")[2] for name in missing}
    if unknown or not found:
        raise DomainError(f"designs is {list(settings.designs)}, which no source has finished: name others, or none.")
    jobs = []
    for kind in KINDS:
        if kind in settings.claims:
            speeds: tuple[float | None, ...] = settings.rates if kind == "rate" else (None,)
            jobs += [Job(source=s, design=d, kind=kind, rate=v) for v in speeds for s, d in found]
    return jobs, missing


def run(settings: Settings, out: Path, progress: Progress) -> None:
    """Run the study into the folder `out`; claims that are there already, from the same loops, are kept."""
    began = time.time()
    jobs, missing = jobs_of(settings)
    make_folder(out)
    keys = {job.name: key_of(settings, job) for job in jobs}
    write_json(out / "settings.json", {"study": NAME, **dataclasses.asdict(settings)})
    write_json(out / "claims.json", keys)  # what belongs to these settings; other folders are leftovers
    for name in missing:
        progress.log(f"{name} is not finished and left out")
    run_jobs(run_claim, [(job.name, (settings, job, out)) for job in jobs], jobs=settings.jobs, progress=progress)
    write_json(out / "run.json", run_record(seed=settings.seed, began=began) | {"unfinished": missing})
    write_report(out)
    progress.log(f"report in {out / 'report.md'}")


def key_of(settings: Settings, job: Job) -> str:
    """A key of everything that a stored claim depends on: the loop's bytes among it."""
    prefixes = {"fastest": "fastest", "quadratic": "box_", "gain": "gain_"}
    relevant: dict[str, Any] = {"time_limit": settings.time_limit}
    if job.kind in prefixes:
        ours = dataclasses.asdict(settings)
        relevant |= {key: value for key, value in ours.items() if key.startswith(prefixes[job.kind])}
    return fingerprint(relevant, job.kind, job.rate, sha256(job.loop), lpvhinf.__version__)


def sha256(path: Path) -> str:
    """Of a file's bytes."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise StorageError(f"{path} cannot be read: {error}. Run the study of this design again.") from None


def run_claim(settings: Settings, job: Job, out: Path, progress: Progress) -> None:
    """Prove, save and check one claim, unless it is there already."""
    folder, key = out / "claims" / job.name, key_of(settings, job)
    make_folder(folder)
    if finished(folder, key):
        stored = read_json(folder / "summary.json")
        path = folder / CERTIFICATE
        if not stored["certificate"] or (path.is_file() and sha256(path) == stored["certificate"]["sha256"]):
            progress.log("taken from the results folder")
            return
    found, certificate = carry_out(settings, job, folder, progress)
    described = None if certificate is None else {**certificate, "sha256": sha256(folder / CERTIFICATE)}
    extra = {**dataclasses.asdict(job), "certificate": described}
    save(folder, key, dataclasses.replace(found, values={**found.values, **extra}))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the study; the exit status is 1 after an error of ours."""
    parser = argparse.ArgumentParser(prog="python -m studies.certify", description="Certify the designs of studies.")
    parser.add_argument(
        "--from",
        dest="sources",
        action="append",
        help="results folder with designs; may be repeated, else the preset's",
    )
    parser.add_argument("--preset", default="quick", help="quick, full, or a .toml file")
    parser.add_argument("--out", type=Path, default=Path("results") / NAME, help="results folder")
    parser.add_argument("--jobs", type=int, help="processes, default as in the preset")
    arguments = parser.parse_args(argv)

    def work() -> None:
        sources = None if arguments.sources is None else tuple(arguments.sources)
        settings = load_settings(Settings, NAME, arguments.preset, sources=sources, jobs=arguments.jobs)
        with TerminalProgress() as progress:
            run(settings, arguments.out, progress)

    return exit_status(work, interrupted="run the same command again to go on")


if __name__ == "__main__":
    sys.exit(main())
