"""Generalized plants known at grid points, and what is taken for them between the points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.lpv.scheduling import BasisFunction, grid_points
from lpvhinf.statespace.generalized import NAMES, GeneralizedPlant
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

#: Largest relative residual with which plants at the grid points count as a combination of functions.
IN_SPAN = 1e-9

PlantFunction = Callable[[Array], GeneralizedPlant]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantFamily:
    """Plants at grid points, and a function that gives them at any position.

    Attributes
    ----------
    points : (N, n_p)
    plants : tuple of GeneralizedPlant
        At the points.
    at : callable
        p (n_p,) -> GeneralizedPlant.
    between : str
        How plants between the points are found: "given", "combination of functions" (which agrees with all points
        though it has fewer coefficients) or "piecewise linear".
    """

    points: Array
    plants: tuple[GeneralizedPlant, ...]
    at: PlantFunction
    between: str


def plant_family(
    plants: Sequence[GeneralizedPlant] | LPVGeneralizedPlant | PlantFunction,
    points: ArrayLike,
    basis: BasisFunction | None = None,
) -> PlantFamily:
    """Read the plants of a synthesis: a sequence, one for each point, an LPV plant, or a function of p.

    Raises
    ------
    DimensionError
        If sizes or numbers disagree.
    DomainError
        If an entry is no GeneralizedPlant.
    """
    if isinstance(plants, LPVGeneralizedPlant):
        where = grid_points(points, len(np.asarray(points)))
        return _family(where, plants.sample(where), plants.at, "given")
    if callable(plants):
        where = grid_points(points, len(np.asarray(points)))
        return _family(where, [plants(p) for p in where], plants, "given")
    try:
        given = list(plants)
    except TypeError as error:
        raise DomainError(
            f"plants is {type(plants).__name__}, wanted a sequence of GeneralizedPlant, one for each point."
        ) from error
    if not given:
        raise DimensionError("plants is empty, wanted one GeneralizedPlant for each point.")
    where = grid_points(points, len(given))
    family = _family(where, given, lambda p: given[0], "given")
    function, between = _interpolant(where, family.plants, basis)
    return _family(where, given, function, between)


def _family(where: Array, plants: Sequence[GeneralizedPlant], at: PlantFunction, between: str) -> PlantFamily:
    for k, plant in enumerate(plants):
        if not isinstance(plant, GeneralizedPlant):
            raise DomainError(
                f"plants[{k}] is {type(plant).__name__}, wanted a GeneralizedPlant. "
                "Partition a state space with GeneralizedPlant.from_control(P, n_y, n_u)."
            )
        if repr(plant) != repr(plants[0]):
            raise DimensionError(f"plants[{k}] is {plant}, plants[0] is {plants[0]}, wanted the same sizes.")
    return PlantFamily(points=read_only(where), plants=tuple(plants), at=at, between=between)


def _interpolant(
    where: Array, plants: Sequence[GeneralizedPlant], basis: BasisFunction | None
) -> tuple[PlantFunction, str]:
    first = plants[0]
    flat = np.stack([np.concatenate([getattr(P, name).ravel() for name in NAMES]) for P in plants])
    shapes = [getattr(first, name).shape for name in NAMES]
    cuts = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]

    def assembled(row: Array) -> GeneralizedPlant:
        parts = [part.reshape(shape) for part, shape in zip(np.split(row, cuts), shapes, strict=True)]
        return GeneralizedPlant(*parts)

    if len(where) == 1 or not np.any(flat - flat[0]):
        return lambda p: first, "given"

    def functions(p: Array) -> Array:
        extra = np.zeros(0) if basis is None else np.atleast_1d(np.asarray(basis(p)[0], dtype=float))
        return np.concatenate([[1.0], p, extra])

    Phi = np.stack([functions(p) for p in where])
    coefficients, _, rank, _ = np.linalg.lstsq(Phi, flat, rcond=1e-10)
    residual = np.max(np.abs(Phi @ coefficients - flat), axis=0)
    if rank < len(where) and np.all(residual <= IN_SPAN * np.max(np.abs(flat), axis=0)):
        return lambda p: assembled(functions(np.asarray(p, dtype=float).reshape(-1)) @ coefficients), (
            "combination of functions"
        )
    return _piecewise_linear(where, flat, assembled), "piecewise linear"


def _piecewise_linear(where: Array, flat: Array, assembled: Callable[[Array], GeneralizedPlant]) -> PlantFunction:
    moving = np.flatnonzero(np.ptp(where, axis=0) > 0.0)
    low, width = where.min(axis=0)[moving], np.ptp(where, axis=0)[moving]
    scaled = (where[:, moving] - low) / width
    if len(moving) == 1:
        order = np.argsort(scaled[:, 0])
        x, values = scaled[order, 0], flat[order]

        def on_line(p: Array) -> GeneralizedPlant:
            s = float((np.asarray(p, dtype=float).reshape(-1)[moving] - low)[0] / width[0])
            _inside(np.array([s]), p, where)
            k = int(np.clip(np.searchsorted(x, s) - 1, 0, len(x) - 2))
            share = (s - x[k]) / (x[k + 1] - x[k])
            return assembled((1.0 - share) * values[k] + share * values[k + 1])

        return on_line
    from scipy.interpolate import LinearNDInterpolator

    interpolator = LinearNDInterpolator(scaled, flat)

    def in_hull(p: Array) -> GeneralizedPlant:
        s = (np.asarray(p, dtype=float).reshape(-1)[moving] - low) / width
        _inside(s, p, where)
        row = interpolator(np.clip(s, 0.0, 1.0))[0]
        if np.any(np.isnan(row)):
            raise DomainError(
                f"p = {np.asarray(p).tolist()} is outside the hull of the grid points. Add grid points at the corners "
                "of the box, or pass the plants as a function of p."
            )
        return assembled(row)

    return in_hull


def _inside(s: Array, p: Array, where: Array) -> None:
    if np.any(s < -1e-9) or np.any(s > 1.0 + 1e-9):
        raise DomainError(
            f"p = {np.asarray(p).tolist()} is outside the box of the grid, {where.min(axis=0).tolist()} to "
            f"{where.max(axis=0).tolist()}. Extend the grid."
        )
