"""From the mechanical equations of motion to modal form (paper eq. 1-4)."""

from __future__ import annotations

import warnings

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive
from lpvhinf.errors import AssumptionError, DomainError, LpvHinfWarning
from lpvhinf.plant.mechanical import MechanicalModel
from lpvhinf.plant.modal import ModalModel, Residual

NULL_SPACE = 1e-8  # |K E| that is taken for round-off, relative to |K| |E|
RIGID_DAMPING = 1e-6  # damping rate of a rigid-body mode that is taken for zero, relative to the first flexible omega
COUPLING = 1e-3  # relative modal damping coupling below which nothing is said


def modal_form(
    mechanical: MechanicalModel,
    *,
    n_modes: int | None = None,
    rigid_body_modes: ArrayLike | None = None,
    rigid_tolerance: float = 1e-11,
    compliance: bool = True,
) -> ModalModel:
    r"""Mass-normalised modal form of a mechanical model (paper eq. 2-4).

    .. math::

        K V = M V \Omega^2, \qquad V^\top M V = I, \qquad V^\top K V = \Omega^2, \qquad V^\top D V = 2 Z \Omega

    Parameters
    ----------
    mechanical : MechanicalModel
        The equations of motion.
    n_modes : int, optional
        Number of modes to keep, rigid-body modes included; all n_q if left out.
    rigid_body_modes : (n_q, n_rb), optional
        Basis E of the rigid-body motions, K E = 0, whose columns keep their physical meaning: the modal basis is
        :math:`V_{rb} = E M_{rb}^{-1/2}` with :math:`M_{rb} = E^\top M E` and the symmetric root, so that
        q_phys = S eta_rb with :math:`S = M_{rb}^{-1/2}`. If left out, any basis of the null space of K is taken.
    rigid_tolerance : float
        A mode is rigid if its eigenvalue is below this share of the largest one. Ignored counts are never guessed:
        a mode within a factor 1000 above the threshold raises a warning.
    compliance : bool
        Keep the static compliance :math:`\sum v v^\top / \omega^2` of the modes that are left out.

    Returns
    -------
    ModalModel
        Rigid-body modes first, then flexible modes in order of frequency; the largest entry of every flexible mode
        shape is positive.

    Raises
    ------
    AssumptionError
        If `rigid_body_modes` are dependent, K E is not zero, K has more zero modes than columns of E,
        `n_modes` cuts into the rigid-body modes, or a rigid-body mode is damped.
    DimensionError
        If `rigid_body_modes` is not (n_q, n_rb).
    DomainError
        If `n_modes` is not in 1..n_q.

    Warns
    -----
    LpvHinfWarning
        If the modal damping matrix has off-diagonal entries that the modal form neglects.

    Notes
    -----
    The paper writes :math:`\tilde V = M^{-1/2} V` next to :math:`K V = M V \Lambda`. The two do not go together:
    eigenvectors of the pencil (K, M) with :math:`V^\top M V = I` are mass-normalised as they are, while
    :math:`M^{-1/2}` belongs to the eigenvectors of :math:`M^{-1/2} K M^{-1/2}`. Either way
    :math:`\tilde V^\top M \tilde V = I`, and this is what is computed.

    Examples
    --------
    >>> chain = MechanicalModel(
    ...     M=np.diag([1.0, 3.0]), D=np.zeros((2, 2)), K=[[12.0, -12.0], [-12.0, 12.0]],
    ...     input_map=[[1.0], [0.0]], output_map=[[0.0, 1.0]], box=[[0.0, 1.0]])
    >>> modal = modal_form(chain, rigid_body_modes=[[1.0], [1.0]])
    >>> modal.omega.round(12).tolist(), float(modal.rigid_body_scaling[0, 0])
    ([0.0, 4.0], 0.5)
    """
    M, K, n_q = mechanical.M, mechanical.K, mechanical.n_q
    positive("rigid_tolerance", rigid_tolerance)
    eigenvalues, V = scipy.linalg.eigh(K, M)
    threshold = rigid_tolerance * float(np.abs(eigenvalues).max())
    n_rb = int(np.sum(eigenvalues <= threshold))
    if rigid_body_modes is None:
        V_rb, mass_rb, scaling = V[:, :n_rb], np.eye(n_rb), np.eye(n_rb)
    else:
        V_rb, mass_rb, scaling = _physical_basis(M, K, finite_array("rigid_body_modes", rigid_body_modes, (n_q, None)))
        if n_rb > V_rb.shape[1]:
            raise AssumptionError(
                f"rigid_body_modes has {V_rb.shape[1]} columns, but K has {n_rb} zero modes (eigenvalues up to "
                f"{threshold:.3g}). Add the missing motions to the basis, or lower rigid_tolerance."
            )
        n_rb = V_rb.shape[1]
    if n_rb < n_q and eigenvalues[n_rb] < 1e3 * threshold:
        warnings.warn(
            f"Mode {n_rb} with the eigenvalue {eigenvalues[n_rb]:.3g} is taken as flexible, close to the threshold "
            f"{threshold:.3g} of rigid-body modes. Pass rigid_body_modes, or set rigid_tolerance to decide it.",
            LpvHinfWarning,
            stacklevel=2,
        )
    kept = n_q if n_modes is None else n_modes
    if isinstance(kept, bool) or int(kept) != kept or not 1 <= kept <= n_q:
        raise DomainError(f"n_modes is {n_modes!r}, wanted a whole number from 1 to n_q = {n_q}.")
    if kept < n_rb:
        raise AssumptionError(
            f"n_modes is {kept}, but the model has {n_rb} rigid-body modes, which have no static compliance to stand "
            f"for them. Keep at least {n_rb} modes."
        )
    V_f = V[:, n_rb:] - V_rb @ (V_rb.T @ M @ V[:, n_rb:])  # deflate round-off against the chosen basis
    V_f /= np.sqrt(np.einsum("ij,ij->j", V_f, M @ V_f))
    V_f *= np.sign(V_f[np.argmax(np.abs(V_f), axis=0), np.arange(V_f.shape[1])])
    omega = np.concatenate([np.zeros(n_rb), np.sqrt(np.maximum(eigenvalues[n_rb:], 0.0))])
    V = np.hstack([V_rb, V_f])
    zeta = _modal_damping(V, mechanical.D, omega, n_rb, kept)
    residual = None
    if compliance and kept < n_q:
        tail = V[:, kept:] / omega[kept:]
        residual = Residual(tail @ tail.T)
    return ModalModel(
        omega=omega[:kept],
        zeta=zeta[:kept],
        n_rb=n_rb,
        input_map=mechanical.input_map,
        output_map=mechanical.output_map,
        box=mechanical.box,
        V=V[:, :kept],
        residual=residual,
        mass_matrix_rb=mass_rb,
        rigid_body_scaling=scaling,
        input_names=mechanical.input_names,
        output_names=mechanical.output_names,
    )


def _physical_basis(M: Array, K: Array, E: Array) -> tuple[Array, Array, Array]:
    """V_rb = E S, M_rb = E.T M E and S = M_rb^{-1/2}, with the checks of a rigid-body basis."""
    force = np.abs(K @ E).max(axis=0, initial=0.0)
    scale = np.abs(K).max() * np.abs(E).max(axis=0, initial=0.0)
    if np.any(force > NULL_SPACE * scale):
        i = int(np.argmax(force - NULL_SPACE * scale))
        raise AssumptionError(
            f"rigid_body_modes[:, {i}] strains the body: |K E| = {force[i]:.3g} against |K||E| = {scale[i]:.3g}, "
            "wanted K E = 0. Check the order of the coordinates and the units."
        )
    M_rb = E.T @ M @ E
    values, vectors = np.linalg.eigh(M_rb)
    unit = np.sqrt(np.diag(M_rb))
    if np.any(unit == 0.0) or np.linalg.eigvalsh(M_rb / np.outer(unit, unit)).min(initial=1.0) < 1e-10:
        raise AssumptionError("rigid_body_modes are linearly dependent, wanted a basis. Remove the repeated motions.")
    S = (vectors / np.sqrt(values)) @ vectors.T
    return E @ S, M_rb, S


def _modal_damping(V: Array, D: Array, omega: Array, n_rb: int, kept: int) -> Array:
    """Diagonal modal damping of all modes; warns of, or rejects, what a diagonal cannot hold."""
    rates = V.T @ D @ V
    diagonal = np.maximum(np.diag(rates), 0.0)
    limit = RIGID_DAMPING * omega[n_rb] if n_rb < len(omega) else 1e-12
    rigid = np.abs(rates[:n_rb, :kept])
    if rigid.size and rigid.max() > limit:
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(rigid)), rigid.shape))
        raise AssumptionError(
            f"D damps rigid-body mode {i}: (V.T D V)[{i}, {j}] = {rates[i, j]:.3g} 1/s, wanted 0. Leave damping to "
            "the ground out of D (the controller sees it as a disturbance), or add stiffness to make the mode flexible."
        )
    block = np.abs(rates[n_rb:kept, n_rb:kept])
    floor = max(1e-12 * float(diagonal.max(initial=0.0)), np.finfo(float).tiny)  # an undamped mode is no divisor
    root = np.sqrt(np.maximum(diagonal[n_rb:kept], floor))
    coupling = block / np.outer(root, root)
    np.fill_diagonal(coupling, 0.0)
    if coupling.size and coupling.max() > COUPLING and block.max() > 0.0:
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(coupling)), coupling.shape))
        warnings.warn(
            f"The modal form neglects damping between modes: |d_ij| / sqrt(d_ii d_jj) is up to {coupling.max():.3g}, "
            f"between modes {n_rb + i} and {n_rb + j} ({omega[n_rb + i]:.4g} and {omega[n_rb + j]:.4g} rad/s). "
            "This is harmless where the frequencies are far apart compared with the damping.",
            LpvHinfWarning,
            stacklevel=3,
        )
    zeta = np.zeros(len(omega))
    zeta[n_rb:] = diagonal[n_rb:] / (2.0 * omega[n_rb:])
    return zeta
