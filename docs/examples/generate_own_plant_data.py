"""Makes the files of `own_plant.py`: a finite-element model of a wafer table, exported as an engineer would.

The table is a free aluminium plate, 400 x 320 x 12 mm, with a magnet of 0.4 kg at each of four actuators and a
connector of 0.5 kg that takes the centre of gravity off the middle. Kirchhoff plate, Argyris elements of scikit-fem (a
development dependency). What is exported is the three rigid-body modes and five flexible ones, mass-normalised, at
9 x 7 nodes, with seven digits, as a finite-element program prints them.

Usage: ``python docs/examples/generate_own_plant_data.py [FOLDER]``
"""

# ruff: noqa: T201

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import skfem
from skfem.helpers import dd, ddot, trace

from lpvhinf.checks import Array
from lpvhinf.storage import write_text

SIDES = (0.40, 0.32)  # m
THICKNESS, YOUNG, POISSON, DENSITY = 0.012, 70e9, 0.33, 2700.0
MAGNETS = [(a * 0.16, b * 0.12, 0.4) for a in (-1, 1) for b in (-1, 1)]  # x, y [m], mass [kg]
CONNECTOR = (0.12, -0.02, 0.5)
DAMPING = 0.005
N_FLEX = 5
NODES = (9, 7)


def finite_elements(n: int = 6) -> tuple[Any, Any, Any]:
    """Basis, stiffness and mass matrix with n x n cells of two triangles."""
    x, y = (np.linspace(-side / 2, side / 2, n + 1) for side in SIDES)
    basis = skfem.Basis(skfem.MeshTri.init_tensor(x, y), skfem.ElementTriArgyris())
    D = YOUNG * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))

    @skfem.BilinearForm
    def bending(u: Any, v: Any, _: Any) -> Any:
        return D * ((1.0 - POISSON) * ddot(dd(u), dd(v)) + POISSON * trace(dd(u)) * trace(dd(v)))

    @skfem.BilinearForm
    def inertia(u: Any, v: Any, _: Any) -> Any:
        return DENSITY * THICKNESS * u * v

    lumped = np.array([*MAGNETS, CONNECTOR])
    P = basis.probes(lumped[:, :2].T)
    masses = P.T @ scipy.sparse.diags(lumped[:, 2]) @ P
    return basis, bending.assemble(basis).tocsc(), (inertia.assemble(basis) + masses).tocsc()


def rigid_body() -> dict[str, float]:
    """Mass, centre of gravity and inertia of plate and lumped masses, by hand."""
    plate = DENSITY * THICKNESS * SIDES[0] * SIDES[1]
    x, y, m = np.array([(0.0, 0.0, plate), *MAGNETS, CONNECTOR]).T
    c_x, c_y = x @ m / m.sum(), y @ m / m.sum()
    ixx = plate * SIDES[1] ** 2 / 12.0 + m @ (y - c_y) ** 2
    iyy = plate * SIDES[0] ** 2 / 12.0 + m @ (x - c_x) ** 2
    ixy = -m @ ((x - c_x) * (y - c_y))
    return {
        "mass_kg": m.sum(),
        "cog_x_m": c_x,
        "cog_y_m": c_y,
        "ixx_kgm2": ixx,
        "iyy_kgm2": iyy,
        "izz_kgm2": ixx + iyy,
        "ixy_kgm2": ixy,
    }


def modes(places: Array) -> tuple[Array, Array]:
    """Frequencies (n,) [Hz] and mass-normalised shapes (n_places, n), rigid-body modes first."""
    basis, K, M = finite_elements()
    # degrees of freedom are values, slopes and curvatures: scaled to one size
    s = scipy.sparse.diags(1.0 / np.sqrt(K.diagonal() + M.diagonal()))
    start = np.random.default_rng(0).standard_normal(K.shape[0])  # the same modes in every run
    values, vectors = scipy.sparse.linalg.eigsh(
        (s @ K @ s).tocsc(), k=3 + N_FLEX, M=(s @ M @ s).tocsc(), sigma=-1e4, which="LM", v0=start
    )
    shapes = basis.probes(places.T) @ (s @ vectors)
    shapes *= np.sign(shapes[np.argmax(np.abs(shapes), axis=0), np.arange(shapes.shape[1])])
    return np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), np.asarray(shapes)


def main(folder: Path) -> None:
    """Write the three files."""
    x, y = (np.linspace(-side / 2, side / 2, n) for side, n in zip(SIDES, NODES, strict=True))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    frequency, shapes = modes(places)
    body = [f"{name},{value:.7g}" for name, value in rigid_body().items()]
    write_text(folder / "body.csv", "\n".join(["quantity,value", *body]) + "\n")
    rows = [f"{k + 1},{f:.7g},{DAMPING}" for k, f in enumerate(frequency)]
    write_text(folder / "modes.csv", "\n".join(["mode,frequency_hz,damping", *rows]) + "\n")
    columns = ",".join(f"w{k + 1}" for k in range(len(frequency)))
    rows = [
        f"{n + 1},{at[0]:.7g},{at[1]:.7g}," + ",".join(f"{w:.6e}" for w in row)
        for n, (at, row) in enumerate(zip(places, shapes, strict=True))
    ]
    write_text(folder / "shapes.csv", "\n".join([f"node,x_m,y_m,{columns}", *rows]) + "\n")
    print(f"{len(places)} nodes, modes at {', '.join(f'{f:.1f}' for f in frequency)} Hz, in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "own_plant_data")
