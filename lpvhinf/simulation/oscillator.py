"""The exact motion of damped oscillators under a setpoint's acceleration."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array
from lpvhinf.errors import DomainError
from lpvhinf.simulation.setpoint import FourthOrderStep


def oscillator_response(omega: ArrayLike, zeta: ArrayLike, setpoint: FourthOrderStep, times: ArrayLike) -> Array:
    r"""Motion from rest of :math:`\ddot h + 2\zeta\omega\dot h + \omega^2 h = \ddot r(t)`, without discretisation.

    On each piece of the setpoint the acceleration is :math:`a_0 + a_1 \tau + a_2 \tau^2`, and the motion is the
    polynomial that satisfies the equation plus a free vibration in closed form, whose begin is the end of the piece
    before.

    Parameters
    ----------
    omega : (n,) [rad/s]
        Above zero.
    zeta : (n,)
        Of [0, 1).
    setpoint : FourthOrderStep
    times : (n_t,) [s]

    Returns
    -------
    (n, n_t)
        h, zero before the step.

    Raises
    ------
    DomainError
        If an omega is not above zero, or a zeta outside of [0, 1).

    Examples
    --------
    A stiff oscillator follows quasi-statically:

    >>> step = FourthOrderStep(distance=1e-3, snap_time=5e-3)
    >>> h = oscillator_response([1e5], [0.01], step, [0.01])
    >>> round(float(h[0, 0]) * 1e10, 3), step.peak_acceleration
    (5.0, 5.0)
    """
    w, z = finite_array("omega", omega, (None,)), finite_array("zeta", zeta, (np.size(omega),))
    if np.any(w <= 0.0):
        raise DomainError(f"omega has the entry {np.min(w):.6g}, wanted frequencies above 0 rad/s.")
    if np.any((z < 0.0) | (z >= 1.0)):
        raise DomainError(f"zeta is {z.tolist()}, wanted damping ratios of at least 0 and below 1.")
    t = finite_array("times", times, (None,))
    knots = setpoint.knots
    out, state = np.zeros((len(w), len(t))), np.zeros((2, len(w)))
    for k, (a0, a1, snap) in enumerate(setpoint.accelerations):
        forced = _particular(w, z, float(a0), float(a1), 0.5 * float(snap))
        free = state - forced[:2]  # at tau = 0 the polynomial is c_0 and its derivative c_1
        here = (t > knots[k]) & (t <= knots[k + 1])
        out[:, here] = _motion(w, z, free, forced, t[here] - knots[k])[0]
        state = _motion(w, z, free, forced, knots[k + 1 : k + 2] - knots[k])[:, :, 0]
    after = t > knots[-1]
    out[:, after] = _motion(w, z, state, np.zeros((3, len(w))), t[after] - knots[-1])[0]
    return out


def _particular(w: Array, z: Array, a0: float, a1: float, a2: float) -> Array:
    """Coefficients c_0, c_1, c_2 (3, n) of the polynomial that satisfies the equation."""
    c2 = a2 / w**2
    c1 = (a1 - 4.0 * z * w * c2) / w**2
    c0 = (a0 - 2.0 * z * w * c1 - 2.0 * c2) / w**2
    return np.stack([c0, c1, c2])


def _motion(w: Array, z: Array, free: Array, forced: Array, tau: Array) -> Array:
    """Position and velocity (2, n, n_tau) of a free vibration that begins with `free` (2, n), plus the polynomial."""
    damped = (w * np.sqrt(1.0 - z**2))[:, None]
    rate, (x, v) = (z * w)[:, None], free[:, :, None]
    decay, cosine, sine = np.exp(-rate * tau), np.cos(damped * tau), np.sin(damped * tau)
    c0, c1, c2 = forced[:, :, None]
    position = decay * (x * cosine + (v + rate * x) / damped * sine) + c0 + c1 * tau + c2 * tau**2
    stiff = (w**2)[:, None]
    velocity = decay * (v * cosine - (stiff * x + rate * v) / damped * sine) + c1 + 2.0 * c2 * tau
    return np.stack([position, velocity])
