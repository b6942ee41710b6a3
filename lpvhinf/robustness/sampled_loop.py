r"""Plant, delay and controller as a computer sees them: at the sampling instants, without approximating the plant.

The controller's output is held over a sample (zero-order hold) and reaches the plant after a delay of any length
:math:`\tau = (l - m) T` with a whole l and 0 <= m < 1. Within a sample the plant then feels u[k - l] first, and
u[k - l + 1] for the last m T (Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., 1998):

.. math:: x[k+1] = \Phi(T) x[k] + \Phi(m T)\, \Gamma((1 - m) T)\, u[k - l] + \Gamma(m T)\, u[k - l + 1]

with :math:`\Phi(t) = e^{A t}`, :math:`\Gamma(t) = \int_0^t e^{A s} ds\, B`, both in closed form for independent modes.
"""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.robustness.closed_loop import SystemStack
from lpvhinf.robustness.perturbed_plant import ModalStack


def transition(modes: ModalStack, t: float) -> tuple[Array, Array]:
    r""":math:`\Phi(t)` as blocks (N, n, 2, 2) and :math:`\Gamma(t)` (N, 2 n, n_in); the states are (eta, eta' / rate).

    With :math:`\sigma = \zeta\omega` and :math:`\omega_d = \omega\sqrt{1 - \zeta^2}` a unit force moves a mode to
    :math:`\eta(t) = (1 - e^{-\sigma t}(\cos\omega_d t + \tfrac{\sigma}{\omega_d}\sin\omega_d t)) / \omega^2`,
    a rigid-body mode to :math:`t^2 / 2`.
    """
    N, n = modes.omega.shape
    flexible = modes.omega > 0.0
    omega = np.where(flexible, modes.omega, 1.0)
    sigma = modes.zeta * omega
    damped = omega * np.sqrt(1.0 - modes.zeta**2)
    decay, c, s = np.exp(-sigma * t), np.cos(damped * t), np.sin(damped * t)
    rest = decay * (c + sigma / damped * s)  # of a unit displacement
    swing = decay * s / damped  # displacement of a unit velocity
    # 1 - rest loses digits where omega t is small: written by the half angle
    half = 2.0 * np.sin(0.5 * damped * t) ** 2
    step = (-np.expm1(-sigma * t) + decay * (half - sigma / damped * s)) / omega**2
    rest, swing = np.where(flexible, rest, 1.0), np.where(flexible, swing, t)
    step = np.where(flexible, step, 0.5 * t**2)
    back = np.where(flexible, -(omega**2) * swing, 0.0)  # velocity of a unit displacement
    speed = np.where(flexible, decay * (c - sigma / damped * s), 1.0)  # velocity of a unit velocity
    rate = modes.rate
    Phi = np.empty((N, n, 2, 2))
    Phi[:, :, 0, 0], Phi[:, :, 0, 1] = rest, swing * rate
    Phi[:, :, 1, 0], Phi[:, :, 1, 1] = back / rate, speed
    Gamma = np.empty((N, 2 * n, modes.B.shape[2]))
    Gamma[:, 0::2] = step[:, :, None] * modes.B
    Gamma[:, 1::2] = (swing / rate)[:, :, None] * modes.B
    return Phi, Gamma


def sampled_plant(modes: ModalStack, *, n_u: int, sample_time: float, delay: float) -> SystemStack:
    """From u to y at the sampling instants; the states are those of the modes, then u[k - l], ..., u[k - 1]."""
    N, n_modes = modes.omega.shape
    whole = int(np.ceil(delay / sample_time - 1e-9))
    late = max(0.0, whole * sample_time - delay)  # m T
    n, n_y = 2 * n_modes, modes.C.shape[1]
    Phi, _ = transition(modes, sample_time)
    Phi_late, Gamma_late = transition(modes, late)
    _, Gamma_early = transition(modes, sample_time - late)
    old = _times(Phi_late, Gamma_early[:, :, :n_u])
    new = Gamma_late[:, :, :n_u]
    size = n + whole * n_u
    A, B = np.zeros((N, size, size)), np.zeros((N, size, n_u))
    first = 2 * np.arange(n_modes)
    for i in range(2):
        for j in range(2):
            A[:, first + i, first + j] = Phi[:, :, i, j]
    C, D = np.zeros((N, n_y, size)), np.zeros((N, n_y, n_u))
    C[:, :, :n:2] = modes.C
    if whole == 0:
        B[:, :n], D = old, modes.D[:, :, :n_u]
        return SystemStack(A=A, B=B, C=C, D=D)
    A[:, :n, n : n + n_u] = old
    C[:, :, n : n + n_u] = modes.D[:, :, :n_u]  # the compliance shows the input that acts at the instant
    if whole == 1:
        B[:, :n] = new
    else:
        A[:, :n, n + n_u : n + 2 * n_u] = new
    A[:, n : size - n_u, n + n_u :] += np.eye(size - n - n_u)
    B[:, size - n_u :] = np.eye(n_u)
    return SystemStack(A=A, B=B, C=C, D=D)


def _times(Phi: Array, Gamma: Array) -> Array:
    """Blocks (N, n, 2, 2) times (N, 2 n, n_u)."""
    N, n = Phi.shape[:2]
    return (Phi @ Gamma.reshape(N, n, 2, -1)).reshape(N, 2 * n, -1)


def tustin(controller: SystemStack, sample_time: float) -> SystemStack:
    r"""The controllers by the trapezoidal rule, :math:`s = \tfrac{2}{T} \tfrac{z - 1}{z + 1}`.

    Examples
    --------
    An integrator sums the mean of two samples:

    >>> import numpy as np
    >>> one = np.ones((1, 1, 1))
    >>> found = tustin(SystemStack(A=0 * one, B=one, C=one, D=0 * one), 0.1)
    >>> found.A.item(), found.B.item(), found.D.item()
    (1.0, 0.1, 0.05)
    """
    n, h = controller.A.shape[1], 0.5 * sample_time
    eye = np.eye(n)
    # (I - h A)^-1 for (I + h A) and B in one solve; C (I - h A)^-1 follows from A_d = 2 (I - h A)^-1 - I
    inverse = np.linalg.inv(eye - h * controller.A)
    A = 2.0 * inverse - eye
    B = inverse @ controller.B * sample_time
    C = controller.C @ inverse
    return SystemStack(A=A, B=B, C=C, D=controller.D + h * (C @ controller.B))
