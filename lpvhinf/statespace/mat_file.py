"""Systems as MAT files of version 5.

==========================  ==========================================================================================
``A B C D``                 a state space; with ``Ts`` [s] in discrete time
``A B1 B2 ... D22``         a generalized plant
``A B C D`` and ``box``     a state space over the box P: each matrix has the shape rows x cols x k_1 x ... x k_np and
                            holds Chebyshev coefficients, `box` is n_p x 2
==========================  ==========================================================================================

In MATLAB: ``[A, B, C, D] = ssdata(G); save('G.mat', 'A', 'B', 'C', 'D', '-v7')``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import StorageError
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.generalized import NAMES, GeneralizedPlant
from lpvhinf.statespace.interop import as_control, sampled_matrices
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.storage import atomic

if TYPE_CHECKING:
    import control


def write_mat(path: str | os.PathLike[str], system: Any) -> None:
    """Write a system as a MAT file of version 5, atomically.

    Parameters
    ----------
    system : LPVStateSpace, GeneralizedPlant, control.StateSpace or what `as_control` takes

    Examples
    --------
    >>> import tempfile, pathlib
    >>> G = LPVStateSpace.from_coefficients([[[-1.0]], [[0.5]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_mat(pathlib.Path(folder) / "G.mat", G)
    ...     print(read_mat(pathlib.Path(folder) / "G.mat"))
    LPVStateSpace(n_x=1, n_u=1, n_y=1, degree (1,), box [[-1.0, 1.0]])
    """
    arrays: dict[str, Any]
    if isinstance(system, LPVStateSpace):
        arrays = {name: coefficients_out(matrix) for name, matrix in zip("ABCD", system.matrices, strict=True)}
        arrays["box"] = system.box
    elif isinstance(system, GeneralizedPlant):
        arrays = {name: getattr(system, name) for name in NAMES}
    else:
        matrices, dt = sampled_matrices(system)
        arrays = dict(zip("ABCD", matrices, strict=True)) | ({"Ts": dt} if dt else {})
    write_mat_arrays(path, arrays)


def read_mat(path: str | os.PathLike[str]) -> control.StateSpace | LPVStateSpace | GeneralizedPlant:
    """Read a system from a MAT file: which one, its variables tell (see the head of this module).

    Raises
    ------
    StorageError
        If the file cannot be read, is of version 7.3, or its variables are no system.
    DimensionError, DomainError
        If the matrices do not fit together, or an entry is not finite.
    """
    arrays = read_mat_arrays(path)
    if "B1" in arrays:
        missing = [name for name in NAMES[:-1] if name not in arrays]
        if not missing:
            return GeneralizedPlant(**{name: arrays[name] for name in NAMES if name in arrays})
    else:
        missing = [name for name in "ABCD" if name not in arrays]
        if not missing and "box" in arrays:
            return LPVStateSpace(*(coefficients_in(arrays[name], arrays["box"]) for name in "ABCD"))
        if not missing:
            system = as_control(tuple(arrays[name] for name in "ABCD"))
            if "Ts" in arrays and arrays["Ts"].size:
                system.dt = float(arrays["Ts"].ravel()[0])
            return system
    raise StorageError(
        f"{path} has no variable {', '.join(missing)}. Wanted A, B, C, D (with box over P, with Ts in discrete time) "
        f"or {', '.join(NAMES)}."
    )


def coefficients_out(matrix: ChebyshevMatrix) -> Array:
    """Coefficients as (rows, cols, k_1, ..., k_np): MATLAB drops trailing axes of one entry, so degrees come last."""
    return np.moveaxis(matrix.coefficients, (-2, -1), (0, 1))


def coefficients_in(array: Array, box: Array) -> ChebyshevMatrix:
    """The inverse of `coefficients_out`, with the axes that MATLAB dropped."""
    bounds = finite_array("box", box, (None, 2))
    full = np.reshape(array, array.shape + (1,) * (len(bounds) + 2 - array.ndim))
    return ChebyshevMatrix(np.moveaxis(full, (0, 1), (-2, -1)), bounds)


def write_mat_arrays(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write variables as a MAT file of version 5, atomically."""
    import scipy.io

    with atomic(path) as temporary, temporary.open("wb") as stream:
        scipy.io.savemat(stream, dict(arrays), oned_as="column")


def read_mat_arrays(path: str | os.PathLike[str], text: tuple[str, ...] = ()) -> dict[str, Any]:
    """The variables of a MAT file: arrays of floats, and those named in `text` as str.

    Raises
    ------
    StorageError
        If the file cannot be read, is of version 7.3, or a variable is not a full array of real numbers.
    """
    import scipy.io

    try:
        found = scipy.io.loadmat(os.fspath(path), appendmat=False)
    except NotImplementedError as error:
        raise StorageError(f"{path} is a MAT file of version 7.3. Save it in MATLAB with '-v7'.") from error
    except Exception as error:  # scipy raises what a damaged file happens to lead to
        raise StorageError(f"{path} cannot be read as a MAT file: {error!r}. Check the path.") from error
    out: dict[str, Any] = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        if name in text:
            out[name] = str(value[0]) if np.size(value) else ""
        elif not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            kind = getattr(value, "dtype", type(value))
            raise StorageError(f"{path}: {name} has the type {kind}, wanted a full array of real numbers.")
        else:
            out[name] = np.asarray(value, dtype=float)
    return out
