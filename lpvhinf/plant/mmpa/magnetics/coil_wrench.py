"""The magnetics by name: the exact field from tables, or the first harmonic."""

from __future__ import annotations

import hashlib
import os
from weakref import WeakValueDictionary

import numpy as np

from lpvhinf.checks import whole_number
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.plant.mmpa.coils import CoilLayer, CoilWrench
from lpvhinf.plant.mmpa.magnetics.first_harmonic import FirstHarmonicField
from lpvhinf.plant.mmpa.magnetics.separable import SeparableWrench
from lpvhinf.plant.mmpa.magnetics.single_magnet import Winding
from lpvhinf.plant.mmpa.magnetics.superposition import PAD, arrange, mover_grid, superpose
from lpvhinf.plant.mmpa.magnetics.table_cache import single_magnet_tables
from lpvhinf.plant.mmpa.magnetics.tabulated import LayerTable, TabulatedWrench
from lpvhinf.plant.mmpa.magnets import MagnetArray
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.progress import SILENT, Progress

KINDS = ("exact", "first-harmonic")
_TABLES: WeakValueDictionary[str, LayerTable] = WeakValueDictionary()  # 75 MB each: shared while in use


def coil_wrench(
    parameters: MMPAParameters,
    layers: tuple[CoilLayer, ...],
    magnets: MagnetArray,
    *,
    kind: str = "exact",
    cache: bool | str | os.PathLike[str] = True,
    jobs: int = 1,
    progress: Progress = SILENT,
) -> CoilWrench:
    """The generalised force of every coil on the mover, per ampere.

    Parameters
    ----------
    parameters : MMPAParameters
        The actuator.
    layers : tuple of CoilLayer
        The stator; "exact" takes position errors of the coils into account.
    magnets : MagnetArray
        The magnets; "exact" takes the polarization of each into account.
    kind : "exact" or "first-harmonic"
        The field of all cuboids, fringe included, or its first harmonic with a smooth edge, which needs no tables.
    cache : bool or path
        Whether, or in which folder, the tables are kept; by default the one named by the environment variable
        `LPVHINF_CACHE`, else ``~/.cache/lpvhinf``.
    jobs : int
        Processes that build the tables. Above one the calling script needs the usual
        ``if __name__ == "__main__":``.
    progress : Progress
        Told of the building.

    Raises
    ------
    DomainError
        If `kind` or `jobs` is unknown.
    AssumptionError
        If the first harmonic is asked for misplaced coils or unequal magnets, or magnets are off their lattice.
    """
    if kind not in KINDS:
        raise DomainError(f"magnetics is {kind!r}, wanted one of {', '.join(KINDS)}, or an object with `wrench`.")
    whole_number("jobs", jobs, 1)
    if kind == "first-harmonic":
        return _first_harmonic(parameters, layers, magnets)
    arrangement = arrange(magnets, parameters)
    grids = [mover_grid(parameters, layer) for layer in layers]
    windings = [Winding.of(layer) for layer in layers]
    degree = parameters.ritz_degree
    keys = [
        _key(arrangement, parameters.side, degree, winding, grid) for winding, grid in zip(windings, grids, strict=True)
    ]
    tables = {key: table for key in keys if (table := _TABLES.get(key)) is not None}
    if len(tables) < len(keys):
        wide = [grid.wider(arrangement.reach + PAD) for grid in grids]
        tasks = [(k, w, g) for w, g in zip(windings, wide, strict=True) for k in arrangement.kinds]
        single = single_magnet_tables(tasks, cache=cache, jobs=jobs, progress=progress)
        n = len(arrangement.kinds)
        for i, grid in enumerate(grids):
            mine = single[i * n : (i + 1) * n]
            table = LayerTable(grid, superpose(mine, arrangement, grid, parameters.side, degree))
            tables[keys[i]] = _TABLES[keys[i]] = table
    return TabulatedWrench(layers=layers, tables=tuple(tables[key] for key in keys))


def _first_harmonic(parameters: MMPAParameters, layers: tuple[CoilLayer, ...], magnets: MagnetArray) -> SeparableWrench:
    strength = np.linalg.norm(magnets.polarization, axis=1)
    spread = float(np.max(strength) - np.min(strength))
    misplaced = max(float(np.max(np.abs(layer.errors), initial=0.0)) for layer in layers)
    if spread > 1e-9 * float(np.max(strength)) or misplaced > 0.0:
        raise AssumptionError(
            f"the first harmonic knows equal magnets and coils in their places only; here strengths differ by "
            f'{spread:.3g} T and coils are off by up to {misplaced:.3g} m. Use magnetics="exact".'
        )
    field = FirstHarmonicField.from_parameters(parameters, remanence=float(np.mean(strength)))
    return SeparableWrench(field=field, layers=layers, degree=parameters.ritz_degree)


def _key(arrangement: object, *parts: object) -> str:
    """A key of what a superposed table depends on."""

    def text(value: object) -> str:
        if isinstance(value, np.ndarray):
            return str(value.tolist())
        if isinstance(value, tuple | list):
            return str([text(item) for item in value])
        return str(value)

    all_parts = [text(value) for value in vars(arrangement).values()] + [text(part) for part in parts]
    return hashlib.sha256("|".join(all_parts).encode()).hexdigest()
