"""The command `certify`: prove a claim about a stored design for every p of P, and keep the certificate."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf import certify as engine
from lpvhinf.certify.claim import Certificate, Refutation, Undecided
from lpvhinf.certify.refute import UnstablePosition
from lpvhinf.certify.refute_quadratic import Multipliers
from lpvhinf.checks import finite_array, known_options, positive
from lpvhinf.cli.settings_file import read_settings
from lpvhinf.cli.terminal import TerminalProgress
from lpvhinf.errors import DomainError
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import make_folder, write_arrays, write_json
from lpvhinf.stored_design import StoredDesign

CELLS = "lpvhinf.Cells"
KINDS = ("frozen", "quadratic", "rate", "l2")
OPTIONS = ("kind", "rate", "gamma", "box", "decay", "time_limit", "jobs")
SETTINGS = """\
frozen     every fixed p: all eigenvalues left of -decay
quadratic  one Lyapunov matrix: p may move arbitrarily fast
rate       p may move with speeds up to --rate on every axis
l2         the L2 gain of the weighted loop is below --gamma, for fixed p, or with --rate for moving p

A TOML file may hold the same settings (kind, rate, gamma, box, decay, time_limit, jobs); options win over it.
The folder DESIGN/certificates takes NAME.npz (the certificate, if it is proved), NAME-cells.npz and NAME.json.
Exit status: 0 proved, 1 refuted, undecided or an error, 130 interrupted."""

Result = Certificate | Refutation | Undecided


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "certify", help="prove a claim about a design for every position", description=__doc__, epilog=SETTINGS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    command.add_argument(
        "design", type=Path, metavar="DESIGN", help="folder of a design, or an .npz file with an LPVStateSpace"
    )
    command.add_argument("settings", nargs="?", type=Path, help="TOML file, see below")
    command.add_argument("--kind", choices=KINDS, help="default frozen")
    command.add_argument("--rate", type=float, help="largest speed of p on every axis [m/s]")
    command.add_argument("--gamma", type=float, help="bound of the L2 gain")
    command.add_argument("--box", type=float, nargs="+", metavar="M", help="lowest and highest p of each axis [m]")
    command.add_argument("--decay", type=float, help="decay rate [1/s], default 0")
    command.add_argument("--time-limit", type=float, help="[s]")
    command.add_argument("--jobs", type=int, help="processes that share the cells, default 1")
    command.add_argument("--out", type=Path, help="certificate file, default DESIGN/certificates/KIND.npz")
    command.set_defaults(run=run, interrupted="nothing was written")


def run(arguments: argparse.Namespace) -> int:
    """Prove, store and print; 0 if the claim is proved."""
    settings = read(arguments)
    folder = arguments.design
    loop = "performance_loop" if settings["kind"] == "l2" else "closed_loop"
    alone = folder.is_file()
    system = LPVStateSpace.load(folder) if alone else StoredDesign.open(folder).system(loop)
    default = (folder.with_suffix("") if alone else folder) / "certificates" / f"{settings['kind']}.npz"
    out = default if arguments.out is None else arguments.out
    if out.suffix != ".npz":
        raise DomainError(f"--out is {out}, wanted a name that ends with .npz.")
    make_folder(out.parent)
    with TerminalProgress() as progress:
        found = prove(system, settings, progress)
    store(found, out, loop="" if alone else loop)
    for line in described(found):
        print(line)
    if isinstance(found, Certificate):
        print(f"certificate in {out}")
        return 0
    return 1


def read(arguments: argparse.Namespace) -> dict[str, Any]:
    """The settings of the claim, from the file and the options.

    Raises
    ------
    DomainError
        If a setting is unknown, missing for the kind, or has no meaning for it.
    """
    given = read_settings(arguments.settings)
    known_options("certify", given, OPTIONS)
    options = {name: getattr(arguments, name) for name in OPTIONS if getattr(arguments, name) is not None}
    if "box" in options:
        box = options["box"]
        if len(box) % 2:
            raise DomainError(f"--box has {len(box)} numbers, wanted lowest and highest for each axis.")
        options["box"] = [box[i : i + 2] for i in range(0, len(box), 2)]
    settings: dict[str, Any] = {"kind": "frozen"} | given | options
    kind = settings["kind"]
    if kind not in KINDS:
        raise DomainError(f"kind is {kind!r}, wanted one of {', '.join(KINDS)}.")
    if kind == "l2" and "gamma" not in settings:
        raise DomainError("gamma is missing, wanted a bound of the L2 gain. Give --gamma, above the design's gamma.")
    for name, kinds in (("gamma", ("l2",)), ("rate", ("rate", "l2")), ("decay", ("frozen", "quadratic", "rate"))):
        if name in settings and kind not in kinds:
            raise DomainError(f"{name} is given, but kind is {kind!r}. Leave it out, or use kind {kinds[0]!r}.")
    if "time_limit" in settings:
        positive("time_limit", settings["time_limit"], "s")
    if "rate" in settings:
        finite_array("rate", settings["rate"])
    return settings


def prove(system: LPVStateSpace, settings: dict[str, Any], progress: TerminalProgress) -> Result:
    """What the claim of the settings turns out to be."""
    rest = {name: value for name, value in settings.items() if name not in ("kind", "gamma")}
    if settings["kind"] != "l2":
        return engine.stability(system, kind=settings["kind"], progress=progress, **rest)
    kind = "rate" if "rate" in settings else "frozen"
    return engine.l2_gain(system, settings["gamma"], kind=kind, progress=progress, **rest)


def store(found: Result, out: Path, *, loop: str) -> None:
    """Write the certificate, its cells and a summary; remove the certificate of an earlier claim of that name."""
    if isinstance(found, Certificate):
        found.save(out)
    else:
        out.unlink(missing_ok=True)
    cells = out.with_name(f"{out.stem}-cells.npz")
    n_p = len(found.box)
    none = np.zeros((0, n_p, 2))
    if isinstance(found, Certificate):
        arrays = {"cells": found.cells, "margins": found.margins, "remaining": none}
    elif isinstance(found, Undecided):
        arrays = {"cells": found.proved, "margins": np.full(len(found.proved), np.nan), "remaining": found.remaining}
    else:
        arrays = {"cells": none, "margins": np.zeros(0), "remaining": none}
    write_arrays(cells, CELLS, arrays | {"box": np.asarray(found.box)})
    write_json(
        out.with_suffix(".json"),
        {"claim": str(found.claim), "outcome": outcome(found), "loop": loop, "lines": described(found)},
    )


def outcome(found: Result) -> str:
    """One word."""
    return {Certificate: "proved", Refutation: "refuted", Undecided: "undecided"}[type(found)]


def described(found: Result) -> list[str]:
    """The outcome in a few lines."""
    head = f"{outcome(found)}: {found.claim}"
    if isinstance(found, Certificate):
        return [head, f"  {found.n_cells} cells, smallest margin {found.margin:.3g}, {found.cpu_time:.1f} s"]
    if isinstance(found, Refutation):
        return [head, f"  {evidence(found)}"]
    return [
        head,
        f"  {found.reason}; {100.0 * found.proved_share:.1f} % of P is proved, {len(found.remaining)} cells remain",
    ]


def evidence(found: Refutation) -> str:
    """Why a claim is false."""
    it = found.evidence
    if isinstance(it, Multipliers):
        return f"multipliers at {len(it.positions)} positions exclude every common Lyapunov matrix"
    where = f"p = {[float(x) for x in it.position]} m"
    if isinstance(it, UnstablePosition):
        return f"an eigenvalue within {it.radius:.2g} of {it.eigenvalue:.6g} 1/s at {where}"
    return f"the gain is at least {it.gain:.6g} at {where} and {it.omega / (2 * np.pi):.6g} Hz"
