"""Synthetic plants: a free bar with many lightly damped modes, which varies from model to model."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.statespace.generalized import GeneralizedPlant

#: Ranges of damping ratios, and largest deviations of frequencies (relative) and of places from model to model.
DAMPING, DETUNED, MOVED = (1e-3, 1e-2), 0.02, 0.01
#: Weights of the inputs u in z and of the measurement noise in w.
EFFORT, NOISE = 0.1, 0.1


def bars(n_x: int, n_models: int, n_u: int, n_y: int, seed: int = 0) -> list[GeneralizedPlant]:
    r"""Models of a free bar of length 1, driven by forces and seen by sensors along it.

    .. math::

        \ddot\eta_k + 2\zeta_k\omega_k\dot\eta_k + \omega_k^2\eta_k = \phi_k(s)^\top f, \quad
        \phi_k(s) = \sqrt 2 \cos(k \pi s), \quad \phi_0 = 1, \quad \omega_k = k

    z is the displacement at three places and 0.1 u, w a force at two other places and 0.1 noise on y. The first
    2 n_u outputs are displacement and velocity at the actuators, the others displacements elsewhere. A force against
    displacement and velocity at every actuator stabilises all models: the problem has solutions with any structure
    that contains this gain. Damping ratios lie between 0.1 and 1 %, frequencies deviate by up to 2 % and all
    places together by up to 0.01 from model to model. Time is in units of 1 / omega_1.

    Parameters
    ----------
    n_x : int
        Even: the states of n_x / 2 modes, the first of which is rigid.
    n_models, n_u, n_y : int
        n_y at least 2 n_u.
    seed : int

    Returns
    -------
    list of GeneralizedPlant
    """
    rng = np.random.default_rng([seed, n_u, n_y])
    actuators = (np.arange(n_u) + rng.uniform(0.2, 0.8, n_u)) / n_u
    sensors, forces, places = rng.uniform(0.1, 0.9, n_y - 2 * n_u), rng.uniform(0.1, 0.9, 2), rng.uniform(0.1, 0.9, 3)
    k = np.arange(n_x // 2)
    # smaller problems are parts of larger ones: the same bar with fewer modes, the first ones of the same models
    low, high = (float(np.log(zeta)) for zeta in DAMPING)
    damping = np.exp(np.random.default_rng(seed).uniform(low, high, len(k)))
    out = []
    for model in range(n_models):
        varied = np.random.default_rng([seed, model])
        shift = varied.uniform(-MOVED, MOVED)
        omega = k * (1.0 + varied.uniform(-DETUNED, DETUNED, len(k)))
        out.append(_bar(omega, damping, actuators + shift, sensors + shift, forces + shift, places + shift))
    return out


def _bar(
    omega: Array, damping: Array, actuators: Array, sensors: Array, forces: Array, places: Array
) -> GeneralizedPlant:
    """One model, in the states (omega eta, eta') of every mode, (eta, eta') of the rigid one."""
    n_x, n_u, n_y, n_w, n_z = (
        2 * len(omega),
        len(actuators),
        2 * len(actuators) + len(sensors),
        len(forces),
        len(places),
    )
    k = np.arange(len(omega))
    unit = np.where(k > 0, omega, 1.0)

    def velocity(s: Array) -> Array:
        """Rows (len(s), n_x) that read the velocity at places s; their transpose is how a force acts there."""
        shapes = np.where(k > 0, np.sqrt(2.0), 1.0) * np.cos(np.pi * k * s[:, None])
        return np.asarray(np.kron(shapes, [[0.0, 1.0]]))

    def displacement(s: Array) -> Array:
        """Rows that read the displacement."""
        return np.asarray(np.kron(velocity(s)[:, 1::2] / unit, [[1.0, 0.0]]))

    A = np.zeros((n_x, n_x))
    first, second = np.arange(0, n_x, 2), np.arange(1, n_x, 2)
    A[first, second], A[second, first], A[second, second] = unit, -omega, -2.0 * damping * omega
    return GeneralizedPlant(
        A,
        np.hstack([velocity(forces).T, np.zeros((n_x, n_y))]),
        velocity(actuators).T,
        np.vstack([displacement(places), np.zeros((n_u, n_x))]),
        np.vstack([displacement(actuators), velocity(actuators), displacement(sensors)]),
        np.zeros((n_z + n_u, n_w + n_y)),
        np.vstack([np.zeros((n_z, n_u)), EFFORT * np.eye(n_u)]),
        np.hstack([np.zeros((n_y, n_w)), NOISE * np.eye(n_y)]),
    )
