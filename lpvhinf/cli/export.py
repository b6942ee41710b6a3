"""The command `export`: the controller of a stored design in discrete time, as C, JSON and MAT files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array, points_in_box
from lpvhinf.cli.designs import add_design
from lpvhinf.export import SampledController, sampled, save
from lpvhinf.statespace import LPVStateSpace
from lpvhinf.storage import make_folder
from lpvhinf.stored_design import StoredDesign

FORMATS = ("c", "mat", "json")
AXES = ("x", "y", "z", "rx", "ry", "rz")
SETTINGS = """\
Without --at the controller is scheduled: its inputs are e, y and the position p. With --at it is that of one position.
The form trapezoidal solves a linear system each step and is exact at every position; discrete has fitted matrices of a
--degree in p. A controller whose A does not depend on p has one form, which is exact."""


def add(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "export", help="write a design's controller as C, MAT and JSON", description=__doc__, epilog=SETTINGS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    add_design(command)
    command.add_argument("--format", choices=FORMATS, action="append", help="may be repeated, default all")
    command.add_argument(
        "--at", type=float, nargs="+", metavar="M", help="position of a controller that is not scheduled"
    )
    command.add_argument("--period", type=float, default=1e-4, help="sampling period [s], default 1e-4")
    command.add_argument("--form", choices=["trapezoidal", "discrete"], default="trapezoidal", help="of one step")
    command.add_argument("--degree", type=int, help="in p, of the form discrete")
    command.add_argument("--precision", choices=["double", "single"], default="double", help="of the C code")
    command.add_argument("--name", default="controller", help="of the controller, a name in C")
    command.add_argument("--out", type=Path, help="folder, default DESIGN/export")
    command.set_defaults(run=run, interrupted="files that are there are whole")


def run(arguments: argparse.Namespace) -> None:
    """Write the files and name them."""
    design = StoredDesign.open(arguments.design)
    controller = sampled_controller(arguments, design)
    out = make_folder(arguments.out or design.folder / "export")
    print(controller)
    if controller.fit_error > 0.0:
        print(f"largest relative error of the fitted matrices: {controller.fit_error:.2g}")
    for suffix in arguments.format or FORMATS:
        for path in save(controller, out / f"{controller.name}.{suffix}", precision=arguments.precision):
            print(path)


def sampled_controller(arguments: argparse.Namespace, design: StoredDesign) -> SampledController:
    """The controller in discrete time, at one position or scheduled.

    Raises
    ------
    DomainError
        If the position lies outside of P, or the degree is missing.
    """
    K = design.controller
    system: Any = K
    if arguments.at is not None:
        where = points_in_box(np.array(arguments.at), K.box, name="--at")
        system = tuple(frozen(K, where))
    n_rb = len(design.f_bw)
    inputs, outputs = channels(n_rb, K.n_u - n_rb, K.n_y - n_rb)
    return sampled(
        system,
        period=arguments.period,
        form=arguments.form,
        degree=arguments.degree,
        name=arguments.name,
        inputs=inputs,
        outputs=outputs,
    )


def frozen(system: LPVStateSpace, where: Array) -> list[Array]:
    """(A, B, C, D) at one position (1, n_p)."""
    return [matrix[0] for matrix in system.sample(where)]


def channels(n_rb: int, n_out: int, n_flex: int) -> tuple[list[str], list[str]]:
    """Names of the controller's inputs and outputs, with units.

    Examples
    --------
    >>> channels(1, 2, 1)
    (['e_1', 'y_1', 'y_redundant_1 [m]'], ['u_1', 'u_mode_1 [N/sqrt(kg)]'])
    """
    six = n_rb == len(AXES)
    units = ["m", "m", "m", "rad", "rad", "rad"]
    places = [f"{axis} [{unit}]" for axis, unit in zip(AXES, units)] if six else [f"{i + 1}" for i in range(n_rb)]
    forces = [f"{axis} [{unit}/s^2]" for axis, unit in zip(AXES, units)] if six else [f"{i + 1}" for i in range(n_rb)]
    inputs = [f"e_{at}" for at in places] + [f"y_{at}" for at in places]
    inputs += [f"y_redundant_{i + 1} [m]" for i in range(n_out - n_rb)]
    return inputs, [f"u_{at}" for at in forces] + [f"u_mode_{i + 1} [N/sqrt(kg)]" for i in range(n_flex)]
