"""How far plants lie from a nominal one, frequency by frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct.peaks import LIGHT, OFFSETS
from lpvhinf.hinfstruct.response import Complex, Response, largest_sigma
from lpvhinf.statespace.interop import state_space_matrices

KINDS = ("additive", "input", "output")
#: Part of a deviation that the nominal plant's range may fail to explain, relative to the deviation.
UNEXPLAINED = 1e-6


def deviation(
    nominal: Any,
    systems: Sequence[Any],
    omega: Array,
    *,
    kind: str = "additive",
    left: Array | None = None,
    right: Array | None = None,
) -> Array:
    r"""Largest singular values of the deviations E of systems from the nominal one, (N, n_omega).

    ========== ======================================
    additive   :math:`G = G_{nom} + L E R`
    input      :math:`G = G_{nom} (I + L E R)`
    output     :math:`G = (I + L E R) G_{nom}`
    ========== ======================================

    with the diagonal units L and R of the channels.

    Parameters
    ----------
    nominal : system, or a sequence of N systems
        control.StateSpace, (A, B, C, D) or what else `LPVStateSpace.from_system` takes; a sequence where every
        system has a nominal one of its own.
    systems : sequence of N systems
    omega : (n_omega,) rad/s
    kind : "additive", "input" or "output"
    left, right : (n,) optional
        Diagonals of L and R, above zero; ones if left out.

    Raises
    ------
    DomainError
        If the kind is unknown or a unit is not above zero.
    DimensionError
        If sizes disagree.
    AssumptionError
        If no E explains a deviation: the nominal plant has too few inputs (input) or outputs (output). Additive
        deviations always exist.

    Examples
    --------
    >>> lag = ([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> faster = ([[-2.0]], [[2.0]], [[1.0]], [[0.0]])
    >>> deviation(lag, [faster], np.array([1.0]), kind="input").round(4).tolist()  # |(s + 1) / (s/2 + 1) - 1|
    [[0.4472]]
    """
    if kind not in KINDS:
        raise DomainError(f"kind is {kind!r}, wanted one of {', '.join(KINDS)}.")
    frequencies = finite_array("omega", omega, (None,))
    responses = [_response(system) for system in systems]
    own = not isinstance(nominal, tuple) and isinstance(nominal, Sequence)
    references = [_response(system) for system in nominal] if own else [_response(nominal)] * len(responses)
    if len(references) != len(responses):
        raise DimensionError(f"nominal holds {len(references)} systems, wanted one or {len(responses)}.")
    out = np.empty((len(responses), len(frequencies)))
    values: dict[int, Complex] = {}
    for k, (response, reference) in enumerate(zip(responses, references, strict=True)):
        G, G_nom = response.at(frequencies), values.setdefault(id(reference), reference.at(frequencies))
        if G.shape != G_nom.shape:
            raise DimensionError(f"systems[{k}] is {G.shape[1:]}, the nominal one {G_nom.shape[1:]}: wanted equal.")
        E = _explained(G - G_nom, G_nom, kind, k)
        rows, columns = channel_units(E.shape[1:], left, right)
        out[k] = largest_sigma(E / rows[:, None] / columns)
    return out


def channel_units(shape: Sequence[int], left: Array | None, right: Array | None) -> tuple[Array, Array]:
    """The diagonals of L and R for a deviation of the given shape."""
    units = []
    for name, given, n in (("left", left, shape[0]), ("right", right, shape[1])):
        unit = np.ones(n) if given is None else finite_array(name, given, (n,))
        if np.any(unit <= 0.0):
            raise DomainError(f"{name} is {unit.tolist()}, wanted entries above 0.")
        units.append(unit)
    return units[0], units[1]


def _explained(E: Complex, G_nom: Complex, kind: str, k: int) -> Complex:
    """The deviation seen at the nominal plant's input or output."""
    if kind == "additive":
        return E
    inverse = np.linalg.pinv(G_nom)
    seen = inverse @ E if kind == "input" else E @ inverse
    rest = E - (G_nom @ seen if kind == "input" else seen @ G_nom)
    size = np.linalg.norm(E, axis=(1, 2))
    lost = np.linalg.norm(rest, axis=(1, 2)) > UNEXPLAINED * np.maximum(size, 1e-300)
    if np.any(lost):
        raise AssumptionError(
            f"the deviation of systems[{k}] lies outside the range of the nominal plant at {int(np.sum(lost))} "
            f"frequencies, so it is no {kind} uncertainty. Use kind='additive'."
        )
    return np.asarray(seen)


def _response(system: Any) -> Response:
    return Response(*state_space_matrices(system))


def resonance_grid(systems: Sequence[Any], low: float, high: float, *, per_decade: int = 40) -> Array:
    """Frequencies between `low` and `high` [rad/s]: an even spread on a logarithmic axis, denser at light poles.

    Parameters
    ----------
    systems : sequence of systems
        Whose lightly damped poles the grid resolves.
    low, high : float
        rad/s, 0 < low < high.
    per_decade : int
        Of the even spread.
    """
    if not (np.isfinite(high) and 0.0 < low < high):
        raise DomainError(f"low and high are {low!r} and {high!r}, wanted 0 < low < high.")
    parts = [np.geomspace(low, high, max(2, int(np.ceil(per_decade * np.log10(high / low))) + 1))]
    for system in systems:
        poles = np.linalg.eigvals(state_space_matrices(system)[0])
        light = poles[(poles.imag > 0.0) & (np.abs(poles.real) < LIGHT * np.abs(poles))]
        parts.append((light.imag[:, None] + np.abs(light.real)[:, None] * OFFSETS).ravel())
    grid = np.concatenate(parts)
    grid = np.sort(grid[(grid >= low) & (grid <= high)])
    return np.asarray(grid[np.append(True, np.diff(grid) > 1e-9 * grid[1:])])
