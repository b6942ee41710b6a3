"""Checks of what `hinfstruct` is called with."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.hinfstruct.structures import ControllerStructure
from lpvhinf.statespace.generalized import GeneralizedPlant

MEMBERS = ("n_u", "n_y", "n_x", "n_parameters", "realize", "pullback", "initial")


def checked_plants(
    plants: GeneralizedPlant | Sequence[GeneralizedPlant], controller: ControllerStructure
) -> tuple[GeneralizedPlant, ...]:
    """The plants as a tuple, of sizes that fit the controller."""
    for name in MEMBERS:
        if not hasattr(controller, name):
            raise DomainError(
                f"controller is {type(controller).__name__} without {name!r}, wanted an object that follows the "
                "ControllerStructure protocol, such as StaticGain(n_u, n_y)."
            )
    models = (
        (plants,) if isinstance(plants, GeneralizedPlant) else tuple(plants) if isinstance(plants, Sequence) else ()
    )
    if not models or not all(isinstance(P, GeneralizedPlant) for P in models):
        raise DomainError(
            f"plants is {type(plants).__name__}, wanted a GeneralizedPlant or a sequence with at least one. "
            "Convert a state space by GeneralizedPlant.from_control, or freeze an LPV plant at chosen positions."
        )
    for i, P in enumerate(models):
        if (P.n_u, P.n_y) != (controller.n_u, controller.n_y):
            raise DimensionError(
                f"plants[{i}] has n_u={P.n_u}, n_y={P.n_y}, but the controller has n_u={controller.n_u}, "
                f"n_y={controller.n_y}. Make them equal."
            )
        if min(P.n_w, P.n_z) < 1:
            raise DimensionError(f"plants[{i}] has n_w={P.n_w}, n_z={P.n_z}, wanted at least one of each.")
    return models


def checked_positions(points: ArrayLike | None, n: int) -> tuple[Array | None, ...]:
    """One position, or None, a plant."""
    if points is None:
        return (None,) * n
    return tuple(read_only(row) for row in finite_array("points", points, (n, None)))


def checked_initial(initial: ArrayLike | Sequence[ArrayLike] | None, n: int) -> list[Array]:
    """The given starts, each (n,)."""
    if initial is None:
        return []
    array = finite_array("initial", initial)  # type: ignore[arg-type]
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != n or array.shape[0] < 1:
        raise DimensionError(
            f"initial has shape {array.shape}, wanted ({n},) or (starts, {n}), the controller's n_parameters."
        )
    return list(array.copy())
