"""Commutation: smooth position weights of the coils and the weighted pseudo-inverse."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.mmpa.coils import CoilLayer
from lpvhinf.plant.mmpa.parameters import MMPAParameters
from lpvhinf.plant.mmpa.windows import window

MAX_CONDITION = 1e6


def coil_weights(points: Array, layers: Sequence[CoilLayer], parameters: MMPAParameters) -> Array:
    """Weights in [0, 1] of all coils at `points` (N, 2) [m], as (N, n_coils).

    A weight is the product of one window of the coil's distance from the mover's centre along x and one along y.
    Switching coils on and off at once would make the decoupled plant jump; these weights have
    ``parameters.window_order`` continuous derivatives in p.

    Examples
    --------
    >>> from lpvhinf.plant.mmpa.coils import coil_layers
    >>> p = MMPAParameters()
    >>> weights = coil_weights(np.array([[0.0, 0.0]]), coil_layers(p), p)
    >>> weights.shape, bool(weights.max() == 1.0), bool(weights.min() == 0.0)
    ((1, 160), True, True)
    """
    parts = []
    for layer in layers:
        long_y = len(layer.x) >= len(layer.y)  # the layer with many columns has coils that are long along y
        inner_outer = (parameters.window_short, parameters.window_long)
        (x_window, y_window) = inner_outer if long_y else inner_outer[::-1]
        x = window(layer.x - points[:, :1], *x_window, parameters.window_order)
        y = window(layer.y - points[:, 1:], *y_window, parameters.window_order)
        parts.append((x[:, :, None] * y[:, None, :]).reshape(len(points), -1))
    return np.concatenate(parts, axis=1)


def weighted_pseudo_inverse(
    B: ArrayLike, weights: ArrayLike | None = None, *, positions: ArrayLike | None = None
) -> Array:
    r"""The right inverse that minimises :math:`\sum_k u_k^2 / w_k`, for each position.

    .. math:: B^\# = W B^\top (B W B^\top)^{-1}, \qquad B B^\# = I

    Parameters
    ----------
    B : (N, n, n_u) or (n, n_u)
        Input gains with full row rank.
    weights : (N, n_u) or (n_u,), optional
        Weights of the inputs, at least 0; an input with the weight 0 is not used. One for every input if left out.
    positions : (N, n_p), optional
        The positions p that B belongs to, for the messages, which else count them.

    Returns
    -------
    (N, n_u, n) or (n_u, n)

    Raises
    ------
    AssumptionError
        If fewer inputs than rows are active, or the rows are dependent; the message names the position and the
        condition number.
    DimensionError, DomainError
        If sizes disagree, a weight is negative, or a number is not finite.

    Examples
    --------
    >>> weighted_pseudo_inverse([[1.0, 1.0]], [1.0, 3.0]).ravel().tolist()
    [0.25, 0.75]
    """
    gains = finite_array("B", B)
    if gains.ndim not in (2, 3):
        raise DimensionError(f"B has shape {gains.shape}, wanted (N, n, n_u) or (n, n_u).")
    many = gains.ndim == 3
    gains = gains if many else gains[None]
    N, n, n_u = gains.shape
    w = np.ones(n_u) if weights is None else finite_array("weights", weights)
    if w.shape not in ((n_u,), (N, n_u)):
        raise DimensionError(f"weights has shape {w.shape}, wanted ({n_u},) or ({N}, {n_u}).")
    if np.any(w < 0.0):
        raise DomainError(f"weights has the entry {w.min():.6g}, wanted weights of at least 0.")
    w = np.broadcast_to(w, (N, n_u))
    at = None if positions is None else finite_array("positions", positions, (N, None))

    def where(i: int) -> str:
        return f"position {i}" if at is None else f"p = {at[i].tolist()}"

    active = np.count_nonzero(w, axis=1)
    if np.any(active < n):
        i = int(np.argmax(active < n))
        raise AssumptionError(
            f"Only {active[i]} of {n_u} inputs are active at {where(i)}, wanted at least {n}, one for each row of B "
            "(condition number inf). Widen the windows of the weights, or decouple fewer modes."
        )
    weighted = w[:, None, :] * gains
    gram = weighted @ gains.transpose(0, 2, 1)
    # rows have different units (N, N m, modal): scale them before judging the rank
    diagonal = np.einsum("nii->ni", gram)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(scale[:, :, None] * gram * scale[:, None, :])
    ratio = values[:, -1] / np.maximum(values[:, 0], np.finfo(float).tiny)
    if np.any(ratio > MAX_CONDITION**2):
        i = int(np.argmax(ratio))
        number = np.sqrt(ratio[i]) if values[i, 0] > 0.0 else np.inf
        raise AssumptionError(
            f"The {n} rows of B are dependent at {where(i)}: condition number {number:.3g} after row scaling, wanted "
            f"at most {MAX_CONDITION:.0e}. Widen the windows of the weights, or decouple fewer modes."
        )
    inverse = (vectors / values[:, None, :]) @ vectors.transpose(0, 2, 1)
    inverse = scale[:, :, None] * inverse * scale[:, None, :]
    result = weighted.transpose(0, 2, 1) @ inverse
    return np.asarray(result if many else result[0])
