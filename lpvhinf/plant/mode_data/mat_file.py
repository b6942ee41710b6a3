"""Modal data as a MAT file with one variable for each array.

=====================  ===================================================================================
``frequency_hz``       n_modes eigenfrequencies [Hz], row or column
``damping``            n_modes damping ratios [-], or one number
``mass``               [kg]
``centre_of_gravity``  x, y, z [m], row or column
``inertia``            3 x 3 about the centre of gravity, or its diagonal [kg m2]
``points``             n_nodes x 2 or x 3 [m]
``shapes``             n_nodes x n_modes (w), or n_nodes x 3 x n_modes (u, v, w) [1/sqrt(kg)]
``polynomials``        (nx + 1) x (ny + 1) x n_modes, or (nx + 1) x (ny + 1) x 3 x n_modes; instead of shapes
``area``               2 x 2, rows (lowest, highest) of x and y [m]; with polynomials
``modal_mass``         n_modes [kg]; if the shapes are not mass-normalised
``node_mass``          n_nodes [kg]; optional
=====================  ===================================================================================

MATLAB drops the last axis of an array if it has one entry only; it is put back here where there is one mode.
"""

from __future__ import annotations

import os

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.errors import StorageError
from lpvhinf.storage import atomic

NEEDED = ("frequency_hz", "damping", "mass", "centre_of_gravity", "inertia")
VECTORS = ("frequency_hz", "centre_of_gravity", "modal_mass", "node_mass")
OPTIONAL = ("points", "shapes", "polynomials", "area", "modal_mass", "node_mass")


def read_mat(path: str | os.PathLike[str]) -> dict[str, Array]:
    """The arrays of a MAT file, named as the arguments of `ModeData` and `RigidBody`.

    Raises
    ------
    StorageError
        If the file cannot be read, is of version 7.3, or a variable is missing, unknown or not numeric.
    """
    import scipy.io

    try:
        found = scipy.io.loadmat(os.fspath(path), appendmat=False)
    except NotImplementedError as error:
        raise StorageError(
            f"{path} is a MAT file of version 7.3. Save it in MATLAB with save(file, '-struct', 'data', '-v7')."
        ) from error
    except Exception as error:  # scipy raises what a damaged file happens to lead to
        raise StorageError(f"{path} cannot be read as a MAT file: {error!r}. Check the path.") from error
    arrays = {name: value for name, value in found.items() if not name.startswith("__")}
    missing = [name for name in NEEDED if name not in arrays]
    unknown = [name for name in arrays if name not in NEEDED + OPTIONAL]
    if missing or unknown:
        what = f"has no variable {', '.join(missing)}" if missing else f"has the variable {', '.join(unknown)}"
        raise StorageError(f"{path} {what}. Wanted {', '.join(NEEDED)}, and of {', '.join(OPTIONAL)} those you have.")
    out = {}
    for name, value in arrays.items():
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            kind = getattr(value, "dtype", type(value))
            raise StorageError(f"{path}: {name} has the type {kind}, wanted a full array of real numbers.")
        out[name] = np.asarray(value, dtype=float)
    for name in VECTORS:
        if name in out:
            out[name] = out[name].ravel()
    out["mass"] = _scalar(out["mass"])
    out["damping"] = _scalar(out["damping"].ravel())
    out["inertia"] = out["inertia"].ravel() if out["inertia"].size == 3 else out["inertia"]
    if len(out["frequency_hz"]) == 1:
        if "shapes" in out and out["shapes"].shape[1:] == (3,):
            out["shapes"] = out["shapes"][..., None]
        if "polynomials" in out and (out["polynomials"].ndim == 2 or out["polynomials"].shape[-1] == 3):
            out["polynomials"] = out["polynomials"][..., None]
    return out


def write_mat(path: str | os.PathLike[str], arrays: dict[str, Array]) -> None:
    """Write what `read_mat` reads, as version 5."""
    import scipy.io

    with atomic(path) as temporary, temporary.open("wb") as stream:
        scipy.io.savemat(stream, arrays, oned_as="column")


def _scalar(array: Array) -> Array:
    return array.reshape(()) if array.size == 1 else array
