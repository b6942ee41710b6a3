"""Checks of the arguments of a claim."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.certify.system import CanonicalSystem
from lpvhinf.checks import Array, box_array, finite_array
from lpvhinf.errors import DimensionError, DomainError

KINDS = ("frozen", "quadratic", "rate")


def sub_box(box: ArrayLike | None, whole_box: Array) -> Array:
    """The claim's box: a part of the system's, or all of it."""
    if box is None:
        return whole_box
    part = box_array(box)
    if part.shape != whole_box.shape:
        raise DimensionError(f"box has shape {part.shape}, wanted {whole_box.shape}: a row for every coordinate of p.")
    if np.any(part[:, 0] < whole_box[:, 0]) or np.any(part[:, 1] > whole_box[:, 1]):
        raise DomainError(f"box {part.tolist()} leaves the system's box {whole_box.tolist()}. Keep inside it.")
    return part


def known(name: str, value: str, known: tuple[str, ...]) -> None:
    """A `DomainError` if a word is not one of those that are known."""
    if value not in known:
        raise DomainError(f"{name} is {value!r}, wanted one of {', '.join(map(repr, known))}.")


def decay_rate(decay: float) -> float:
    """A decay rate of at least 0."""
    value = float(finite_array("decay", decay, ()))
    if value < 0.0:
        raise DomainError(f"decay is {value}, wanted at least 0 1/s.")
    return value


def rate_box(rate: ArrayLike | float | None, kind: str, n_p: int) -> Array | None:
    """The box of dp/dt; a speed v means [-v, v] on every axis."""
    if kind != "rate":
        if rate is not None:
            raise DomainError(f"rate is given, but kind is {kind!r}. Use kind='rate', or leave rate out.")
        return None
    if rate is None:
        raise DomainError("rate is missing. Give the box of dp/dt (n_p, 2), or a speed.")
    value = finite_array("rate", rate)
    if value.ndim == 0:
        value = np.tile([-abs(float(value)), abs(float(value))], (n_p, 1))
    value = finite_array("rate", value, (n_p, 2))
    if np.any(value[:, 0] > 0.0) or np.any(value[:, 1] < 0.0):
        raise DomainError(f"rate is {value.tolist()}, wanted lowest <= 0 <= highest on every axis.")
    return value


def remainder_kind(remainder: Mapping[str, ArrayLike] | None, remainder_is: str) -> str:
    """What the claim says of the remainder."""
    known("remainder_is", remainder_is, ("bounded", "sampled"))
    return "none" if remainder is None else remainder_is


def remainder_bounds(remainder: Mapping[str, ArrayLike] | None, system: CanonicalSystem) -> dict[str, Array]:
    """Entrywise bounds by the matrix's letter, zeros where none is given."""
    if remainder is None:
        return {}
    unknown = set(remainder) - set("ABCD")
    if unknown:
        raise DomainError(f"remainder names {sorted(unknown)}, wanted matrices among A, B, C, D.")
    bounds = {}
    for name, matrix in system.matrices.items():
        rows, cols = matrix.shape[-2:]
        bounds[name] = finite_array(f"remainder[{name!r}]", remainder.get(name, np.zeros((rows, cols))), (rows, cols))
        if np.any(bounds[name] < 0.0):
            raise DomainError(f"remainder[{name!r}] has negative entries, wanted bounds of absolute values.")
    return bounds
