"""Generalized plants with a channel for dynamic uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DimensionError
from lpvhinf.hinfstruct.uncertainty.deviation import channel_units
from lpvhinf.hinfstruct.uncertainty.weight import UncertaintyWeight
from lpvhinf.statespace.generalized import GeneralizedPlant


@dataclass(frozen=True, kw_only=True, eq=False)
class UncertainPlant:
    r"""A generalized plant whose first disturbances and performance outputs are those of :math:`\Delta`.

    :math:`d = \Delta q` with any stable :math:`\|\Delta\|_\infty < 1`; w = (d, w), z = (q, z).

    Attributes
    ----------
    plant : GeneralizedPlant
        With the weight inside.
    n_d, n_q : int
        Outputs and inputs of Delta.
    nominal : GeneralizedPlant
        Without the channel, for Delta = 0.
    """

    plant: GeneralizedPlant
    n_d: int
    n_q: int
    nominal: GeneralizedPlant


def uncertain_plant(
    plant: GeneralizedPlant,
    weight: UncertaintyWeight,
    *,
    u: slice | None = None,
    y: slice | None = None,
    enters_as: slice | None = None,
    adds: slice | None = None,
) -> UncertainPlant:
    r"""Add the channel of a weight to a generalized plant.

    Where the uncertain part sits is said by the signals around it:

    * q, what it is driven by: :math:`u` (kinds "additive" and "input") or the part of y that u and the states
      cause (kind "output"). Where disturbances act at the plant's input, ``adds`` names them: they drive it, too.
    * d, what it does: it adds to u (kind "input") or to y (kinds "additive" and "output"). Where the
      performance outputs see the plant's output, d must reach them as well: ``enters_as`` names the disturbances
      that act at the same place, such as an output disturbance, and d takes their ways.

    Parameters
    ----------
    plant : GeneralizedPlant
        Of the nominal plant.
    weight : UncertaintyWeight
    u, y : slice, optional
        The controls and measurements that belong to the uncertain part; all if left out.
    enters_as : slice, optional
        Disturbances that enter where d does. Left out: d adds to the controls `u` (with all their ways, also to
        performance outputs that weigh u), or to the measurements `y` alone.
    adds : slice, optional
        Disturbances that add to the controls `u` at the plant.

    Returns
    -------
    UncertainPlant

    Raises
    ------
    DimensionError
        If the numbers of signals disagree.

    Examples
    --------
    >>> from lpvhinf.hinfstruct.uncertainty.weight import uncertainty_weight
    >>> lags = [([[-1.0]], [[1.0]], [[gain]], [[0.0]]) for gain in (0.5, 1.0, 1.5)]
    >>> W = uncertainty_weight(lags[1], lags, [0.1, 10.0], kind="input", order=0)
    >>> P = GeneralizedPlant([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], [[0.0]])
    >>> U = uncertain_plant(P, W)
    >>> U.plant, U.n_d, U.n_q
    (GeneralizedPlant(n_x=1, n_w=2, n_u=1, n_z=2, n_y=1), 1, 1)
    """
    P, n_x = plant, plant.n_x
    controls = np.arange(P.n_u)[slice(None) if u is None else u]
    measured = np.arange(P.n_y)[slice(None) if y is None else y]
    added = np.arange(P.n_w)[adds] if adds is not None else np.zeros(0, dtype=int)
    if len(added) not in (0, len(controls)):
        raise DimensionError(f"adds names {len(added)} disturbances, wanted {len(controls)}, one for each control.")
    if weight.kind == "output":
        # what u and the states bring about: noise of the measurement is not part of the plant's output
        C_q, D_qw, D_qu = P.C2[measured], np.zeros((len(measured), P.n_w)), P.D22[measured]
    else:
        C_q, D_qw, D_qu = np.zeros((len(controls), n_x)), np.zeros((len(controls), P.n_w)), np.eye(P.n_u)[controls]
        D_qw[np.arange(len(added)), added] = 1.0
    if enters_as is not None:
        B_d, D_zd, D_yd = P.B1[:, enters_as], P.D11[:, enters_as], P.D21[:, enters_as]
    elif weight.kind == "input":
        B_d, D_zd, D_yd = P.B2[:, controls], P.D12[:, controls], P.D22[:, controls]
    else:
        B_d, D_zd = np.zeros((n_x, len(measured))), np.zeros((P.n_z, len(measured)))
        D_yd = np.eye(P.n_y)[:, measured]
    n_q, n_d = len(C_q), B_d.shape[1]
    wanted = len(controls) if weight.kind == "input" else len(measured)
    if n_d != wanted:
        raise DimensionError(f"enters_as names {n_d} disturbances, wanted {wanted}, one for each output of Delta.")
    L, R = channel_units((n_d, n_q), weight.left, weight.right)
    return _weighted(P, weight, (B_d * L, D_zd * L, D_yd * L), (R[:, None] * C_q, R[:, None] * D_qw, R[:, None] * D_qu))


def _weighted(
    P: GeneralizedPlant, weight: UncertaintyWeight, into: tuple[Array, Array, Array], out: tuple[Array, Array, Array]
) -> UncertainPlant:
    """The plant with d entering by `into` and W q leaving by `out`; W stands on the smaller side of Delta."""
    (B_d, D_zd, D_yd), (C_q, D_qw, D_qu) = into, out
    n_d, n_q, n_x = B_d.shape[1], len(C_q), P.n_x
    at_q = n_q <= n_d
    n = min(n_q, n_d)
    A, B, C, D = (np.kron(np.eye(n), m) for m in (weight.A, weight.B, weight.C, weight.D))
    n_W = len(A)
    zero = np.zeros
    if at_q:
        return UncertainPlant(
            plant=GeneralizedPlant(
                np.block([[P.A, zero((n_x, n_W))], [B @ C_q, A]]),
                np.block([[B_d, P.B1], [zero((n_W, n_d)), B @ D_qw]]),
                np.vstack([P.B2, B @ D_qu]),
                np.block([[D @ C_q, C], [P.C1, zero((P.n_z, n_W))]]),
                np.hstack([P.C2, zero((P.n_y, n_W))]),
                np.block([[zero((n_q, n_d)), D @ D_qw], [D_zd, P.D11]]),
                np.vstack([D @ D_qu, P.D12]),
                np.hstack([D_yd, P.D21]),
                P.D22,
            ),
            n_d=n_d,
            n_q=n_q,
            nominal=P,
        )
    return UncertainPlant(
        plant=GeneralizedPlant(
            np.block([[P.A, B_d @ C], [zero((n_W, n_x)), A]]),
            np.block([[B_d @ D, P.B1], [B, zero((n_W, P.n_w))]]),
            np.vstack([P.B2, zero((n_W, P.n_u))]),
            np.block([[C_q, zero((n_q, n_W))], [P.C1, D_zd @ C]]),
            np.hstack([P.C2, D_yd @ C]),
            np.block([[zero((n_q, n_d)), D_qw], [D_zd @ D, P.D11]]),
            np.vstack([D_qu, P.D12]),
            np.hstack([D_yd @ D, P.D21]),
            P.D22,
        ),
        n_d=n_d,
        n_q=n_q,
        nominal=P,
    )


def delta_closed(uncertain: UncertainPlant, delta: ArrayLike) -> GeneralizedPlant:
    """The plant for one constant Delta (n_d, n_q): a member of the set, for checks."""
    P, n_d, n_q = uncertain.plant, uncertain.n_d, uncertain.n_q
    Delta = finite_array("delta", delta, (n_d, n_q))
    B_d, D_zd, D_yd = P.B1[:, :n_d], P.D11[n_q:, :n_d], P.D21[:, :n_d]
    C_q, D_qw, D_qu = P.C1[:n_q], P.D11[:n_q, n_d:], P.D12[:n_q]
    gain = np.linalg.solve(np.eye(n_d) - Delta @ P.D11[:n_q, :n_d], Delta)
    return GeneralizedPlant(
        P.A + B_d @ gain @ C_q,
        P.B1[:, n_d:] + B_d @ gain @ D_qw,
        P.B2 + B_d @ gain @ D_qu,
        P.C1[n_q:] + D_zd @ gain @ C_q,
        P.C2 + D_yd @ gain @ C_q,
        P.D11[n_q:, n_d:] + D_zd @ gain @ D_qw,
        P.D12[n_q:] + D_zd @ gain @ D_qu,
        P.D21[:, n_d:] + D_yd @ gain @ D_qw,
        P.D22 + D_yd @ gain @ D_qu,
    )
