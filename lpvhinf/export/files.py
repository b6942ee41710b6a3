"""Sampled controllers as files: JSON and MAT, which are read back, and C."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import finite_array
from lpvhinf.errors import LpvHinfError, StorageError
from lpvhinf.export.c_code import c_code
from lpvhinf.export.controller import SampledController
from lpvhinf.export.matlab import loader
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.statespace.mat_file import coefficients_in, coefficients_out, read_mat_arrays, write_mat_arrays
from lpvhinf.storage import read_json, write_json, write_text

KIND = "lpvhinf.SampledController"
FORMAT = 1
TEXT = ("kind", "name", "form", "inputs", "outputs")
SUFFIXES = (".json", ".mat", ".c")


def save(controller: SampledController, path: str | os.PathLike[str], *, precision: str = "double") -> tuple[Path, ...]:
    """Write a controller as its suffix says, each file atomically; returns the paths.

    Parameters
    ----------
    controller : SampledController
    path : path
        ".json": everything, coefficients as (k_1, ..., k_np, rows, cols); ".mat": MAT version 5, coefficients as
        (rows, cols, k_1, ..., k_np), with a loader load_NAME.m beside it; ".c": a source and its header, called after
        the controller, in the folder of `path`.
    precision : "double" or "single"
        Of the C code.

    Raises
    ------
    StorageError
        If the suffix is another one, or the file of C code is not called after the controller.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lpvhinf.export import load, sampled
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in save(sampled(2.0, name="gain"), pathlib.Path(folder) / "gain.c")]
    ['gain.h', 'gain.c']
    """
    target = Path(path)
    suffix = _known(target)
    if suffix == ".json":
        write_json(target, _description(controller))
        return (target,)
    if suffix == ".mat":
        arrays = _description(controller) | {
            name: coefficients_out(matrix) for name, matrix in zip("ABCD", controller.matrices, strict=True)
        }
        # MATLAB has no list of texts that other programs read; one text with a line each
        arrays |= {name: "\n".join(arrays[name]) for name in ("inputs", "outputs")}
        write_mat_arrays(target, arrays)
        script = target.with_name(f"load_{controller.name}.m")
        write_text(script, loader(controller, target.name))
        return target, script
    if target.stem != controller.name:
        raise StorageError(
            f"{path} is not called after the controller. Use {controller.name}.c, or rename the controller."
        )
    header, source = c_code(controller, precision=precision)
    write_text(target.with_suffix(".h"), header)
    write_text(target, source)
    return target.with_suffix(".h"), target


def load(path: str | os.PathLike[str]) -> SampledController:
    """Read what `save` wrote as JSON or MAT.

    Raises
    ------
    StorageError
        If the suffix is unknown, or the file is missing, damaged, of another kind or of a later format.
    """
    target = Path(path)
    suffix = _known(target)
    if suffix == ".c":
        raise StorageError(f"{path} is C code, which is not read. Load the .json or .mat file of the controller.")
    found = read_json(target) if suffix == ".json" else read_mat_arrays(target, TEXT)
    if not isinstance(found, dict) or found.get("kind") != KIND:
        raise StorageError(f"{path} is not a file of kind {KIND}. Check the path.")
    try:
        if int(np.squeeze(found["format"])) != FORMAT:
            raise StorageError(
                f"{path} has the format {found['format']}, wanted {FORMAT}. Export the controller again."
            )
        if suffix == ".mat":
            matrices = [coefficients_in(found[name], found["box"]) for name in "ABCD"]
            names = {key: tuple(found[key].split("\n")) if found[key] else () for key in ("inputs", "outputs")}
        else:
            box = finite_array("box", found["box"], (None, 2))
            matrices = [_matrix(found[name], found[f"{name}_shape"], box) for name in "ABCD"]
            names = {key: tuple(found[key]) for key in ("inputs", "outputs")}
        A, B, C, D = matrices
        return SampledController(
            A=A, B=B, C=C, D=D,
            period=float(np.squeeze(found["period"])),
            form=found["form"],
            name=found["name"],
            fit_error=float(np.squeeze(found["fit_error"])),
            **names,
        )  # fmt: skip
    except StorageError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, LpvHinfError) as error:
        raise StorageError(f"{path} is damaged: {error!r}. Export the controller again.") from error


def _description(controller: SampledController) -> dict[str, Any]:
    K = controller
    matrices = dict(zip("ABCD", K.matrices, strict=True))
    return {
        "kind": KIND,
        "format": FORMAT,
        "name": K.name,
        "form": K.form,
        "period": K.period,
        "box": K.box,
        "inputs": K.inputs,
        "outputs": K.outputs,
        "fit_error": K.fit_error,
        # lists of a matrix without rows or columns forget its shape
        **{f"{name}_shape": np.array(matrix.coefficients.shape) for name, matrix in matrices.items()},
        **{name: matrix.coefficients for name, matrix in matrices.items()},
    }


def _matrix(values: Any, shape: Any, box: Any) -> ChebyshevMatrix:
    return ChebyshevMatrix(np.asarray(values, dtype=float).reshape([int(n) for n in shape]), box)


def _known(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise StorageError(f"{path} has the suffix {path.suffix!r}, wanted one of {', '.join(SUFFIXES)}.")
    return suffix
