"""Extended decoupling of a fully actuated plant: more axes than forces, shared out by weighted least squares."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array


def shared_inputs(excitation: Array, mode_weight: float) -> Array:
    r"""T': rigid-body and modal axes from n_rb virtual forces, the best that weighted least squares can do.

    In mass-normalised coordinates the virtual forces drive the rigid-body modes by the identity and the
    preserved flexible modes by b. No T' makes :math:`[I;\, b]\, T'` the identity of n_rb + n_flex axes; the one
    that comes closest is

    .. math:: T' = \arg\min \big\| W^{1/2} ([I;\, b]\, T' - I) \big\|_F
              = (I + \rho^2 b^\top b)^{-1} [\, I \quad \rho^2 b^\top \,], \quad W = \mathrm{diag}(I,\, \rho^2 I).

    It is computed from the singular values of b: a large :math:`\rho` costs no accuracy.

    Parameters
    ----------
    excitation : (N, n_flex, n_rb)
        b at N positions.
    mode_weight : float
        :math:`\rho` > 0.

    Returns
    -------
    (N, n_rb, n_rb + n_flex)

    Examples
    --------
    >>> shared_inputs(np.array([[[1.0, 0.0]]]), 1.0).tolist()
    [[[0.5, 0.0, 0.5], [0.0, 1.0, 0.0]]]
    """
    modes, sizes, forces = np.linalg.svd(excitation, full_matrices=False)
    weighted = (mode_weight * sizes[:, :, None]) ** 2
    columns = np.swapaxes(forces, 1, 2)
    # share of a direction that the modal inputs take: rho^2 s^2 / (1 + rho^2 s^2)
    rigid = np.eye(excitation.shape[2]) - columns @ (weighted / (1.0 + weighted) * forces)
    modal = columns @ (mode_weight**2 * sizes[:, :, None] / (1.0 + weighted) * np.swapaxes(modes, 1, 2))
    return np.concatenate([rigid, modal], axis=2)
