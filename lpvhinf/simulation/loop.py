r"""The closed loop over time: a sampled controller, and a plant whose gains follow the position of the set-point.

p(t) is the set-point's own position, hence exogenous; in a machine it is measured, and differs by the tracking error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.simulation.actuators import Actuators
from lpvhinf.simulation.compliant_feedforward import Compliance, feedforward_inputs
from lpvhinf.simulation.controller_steps import ControllerSteps
from lpvhinf.simulation.plant_steps import ModalPlant, plant_steps, whole_delay
from lpvhinf.simulation.trajectory import Trajectory
from lpvhinf.statespace.lpv import LPVStateSpace

CHUNK = 1000  # samples whose matrices are held at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """What `simulate` returns: N samples, fewer than wanted if the loop was stopped.

    Attributes
    ----------
    times : (N,) [s]
    positions : (N, n_p) [m]
        The scheduling position p.
    setpoint : (N, n_rb) [m, rad]
    error : (N, n_rb) [m, rad]
        r - y_RB, without noise and rounding of the sensors.
    redundant : (N, n_out - n_rb) [m]
        What the redundant readings show.
    inputs : (N, n_in)
        Decoupled inputs that the computer sends, feedforward included, after limits.
    feedback : (N, n_in)
        The controller's own share, before limits.
    states : (N, 2 n_modes)
        (eta, eta') of each mode.
    peak_current : (N,)
        Largest current of any actuator that was asked for; zeros without `Actuators`.
    saturated : (N,) bool
        Where a limit cut the inputs.
    stopped : float or None
        Time at which the loop was stopped because the error had grown without bound [s].
    status : str
    """

    times: Array
    positions: Array
    setpoint: Array
    error: Array
    redundant: Array
    inputs: Array
    feedback: Array
    states: Array
    peak_current: Array
    saturated: Array
    stopped: float | None
    status: str

    def error_of(self, gains: Array) -> Array:
        """Error at another place, for instance the point of control.

        Parameters
        ----------
        gains : (N, n, n_modes)
            Motion of the place per modal coordinate at `positions`, rigid-body columns per m and rad.

        Returns
        -------
        (N, n)
            Of rigid motion by the set-point, less the motion of all modes.
        """
        eta = self.states[:, 0::2].copy()
        C = finite_array("gains", gains, (len(self.times), None, eta.shape[1]))
        n_rb = self.setpoint.shape[1]
        eta[:, :n_rb] -= self.setpoint
        return np.asarray(-np.einsum("noi,ni->no", C, eta))


def simulate(
    plant: DecoupledPlant | LPVStateSpace | ModalPlant,
    controller: LPVStateSpace,
    trajectory: Trajectory,
    *,
    period: float = 1e-4,
    delay: float = 1.5e-4,
    settle: float = 0.0,
    feedforward: bool | str = True,
    compliance: Compliance | None = None,
    noise: ArrayLike = 0.0,
    quantisation: ArrayLike = 0.0,
    disturbance: ArrayLike | None = None,
    actuators: Actuators | None = None,
    substeps: int = 1,
    error_bound: float = 1e-2,
    seed: int = 0,
) -> Motion:
    r"""Move along a set-point under sampled feedback.

    ::

        r --> + --> e --> [K(p)] --> + --> limits --> [hold, delay] --> [plant(p)] --> y
              ^ -            ^       ^                                                 |
              |              |       r''                                               |
              +--------------+--- noise, rounding <------------------------------------+

    Modes are independent and are stepped exactly; gains follow p(t) (`PlantSteps`). The feedforward is the mean of
    :math:`\ddot r` over the sample in which it acts, so that it is early by the delay: a rigid body would then be where
    the set-point wants it. The commutation knows p where its inputs act. The controller gets e and, as its measured
    outputs, y less the set-point's rigid motion, which the feedforward explains: an observer then sees what is left, as
    its model is linear and the feedforward drives no decoupled mode.

    At a limit all inputs are scaled down together, and the controller's pure integrators wait.

    Parameters
    ----------
    plant : DecoupledPlant, LPVStateSpace or ModalPlant
        As polynomials of p.
    controller : LPVStateSpace
        From (e, y) to u_RB, or to (u_RB, u_FM): that of a `Design`, of `lpvsyn`, or any.
    trajectory : Trajectory
        Of all rigid axes; the first n_p are p.
    period, delay : [s]
        Delay from reading to input, above 0.
    settle : [s]
        Time at rest after the set-point.
    feedforward : bool or str
        True is "rigid-body", False "none"; "snap" and "compliance" also make up for what the flexible modes give as
        springs, at the centre of P or along p(t) (`compliance_of`). They act at the rigid inputs.
    compliance : callable (N, n_p) -> (N, n_rb, n_rb), optional
        Springs in place of the plant's own at its rigid outputs, for instance those at the point of control.
    noise, quantisation : float or (n_out,) [m, rad]
        Root mean square of white noise, and step, of every decoupled output.
    disturbance : (N, m), optional
        Accelerations of the first m modes, held over each sample [m/s^2, rad/s^2]. A floor that accelerates by a moves
        the rigid axes by -a relative to it and, as modes are orthogonal to rigid motion, no flexible mode.
    actuators : Actuators, optional
        Without, there are no limits.
    substeps : int
        Pieces of a sample for p; see `PlantSteps`.
    error_bound : float [m, rad]
        An error beyond it ends the run.
    seed : int
        Of the noise.

    Raises
    ------
    DimensionError
        If plant, controller, set-point and disturbance do not fit.
    DomainError
        If a number is out of range, or the set-point leaves P; the message names the first time.
    AssumptionError
        If the plant is not modal, or the controller has a pole at 2/T.

    Examples
    --------
    A mass under PD control:

    >>> from lpvhinf.simulation import MotionLimits, point_to_point, simulate
    >>> P = [[-1.0, 1.0]]
    >>> mass = LPVStateSpace.from_coefficients([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], box=P)
    >>> control = LPVStateSpace.from_coefficients(
    ...     [[-1000.0]], [[1000.0, 0.0]], [[-1e5]], [[1.1e5, 0.0]], box=P)
    >>> move = point_to_point([0.0], [0.1], MotionLimits(acceleration=10.0, snap=1e6), period=1e-4)
    >>> found = simulate(mass, control, move, settle=0.1)
    >>> found.status, float(abs(found.error[-1, 0])) < 1e-9
    ('completed', True)
    """
    modal = _modal(plant)
    n_rb, n_out = modal.n_rb, modal.n_out
    _check_fit(modal, controller, trajectory)
    trajectory.check(box=modal.box)
    T, n_in = positive("period", period, "s"), controller.n_y
    tau, bound = positive("delay", delay, "s"), positive("error_bound", error_bound)
    if not np.isfinite(settle) or settle < 0.0:
        raise DomainError(f"settle is {settle}, wanted 0 or more seconds.")
    moving = trajectory.times(T)
    times = moving[0] + T * np.arange(len(moving) + round(settle / T))
    N, n_p = len(times), len(modal.box)
    whole, _ = whole_delay(tau, T)
    r = trajectory.position(times)
    p = np.clip(trajectory.position(np.append(times, times[-1] + T))[:, :n_p], modal.box[:, 0], modal.box[:, 1])
    ahead = np.zeros((N, n_in))  # means over the samples in which they act
    kind = feedforward if isinstance(feedforward, str) else "rigid-body" if feedforward else "none"
    acting = np.append(times, times[-1] + T) + tau
    ahead[:, :n_rb] = feedforward_inputs(kind, modal, trajectory, acting, T, compliance)
    sigma, steps = _per_output("noise", noise, n_out), _per_output("quantisation", quantisation, n_out)
    added = np.random.default_rng(seed).normal(0.0, 1.0, (N, n_out)) * sigma if np.any(sigma) else None
    rounded = bool(np.any(steps))
    steps_or_one = np.where(steps > 0.0, steps, 1.0)
    forces = _forces(disturbance, N, modal.n_modes)
    path = None if actuators is None else actuators.along(p[:N], n_in)

    x, xi = np.zeros(2 * modal.n_modes), np.zeros(controller.n_x)
    x[0 : 2 * n_rb : 2] = np.linalg.solve(modal.C.sample(p[:1])[0][:n_rb, :n_rb], r[0])
    of_controller = ControllerSteps(controller, T)
    n_c, waiting = controller.n_x, of_controller.integrators
    sent = np.zeros((N + whole, n_in))  # u[k] is in row k + whole
    y_all, feedback, states = np.zeros((N, n_out)), np.zeros((N, n_in)), np.zeros((N, len(x)))
    peak, saturated = np.zeros(N), np.zeros(N, dtype=bool)
    v = np.zeros(n_rb + n_out)
    stopped, status = None, "completed"
    for first in range(0, N, CHUNK):
        part = slice(first, min(first + CHUNK, N))
        here, place = _distinct(p[part], p[first + 1 : part.stop + 1])
        plants = plant_steps(modal, here[:, :n_p], here[:, n_p:], period=T, delay=tau, substeps=substeps, inputs=n_in)
        K = of_controller.at(here[:, :n_p])
        for k in range(first, part.stop):
            i = place[k - first]
            states[k] = x
            y = plants.C[i] @ x[0::2] + plants.D[i] @ sent[k]
            y_all[k] = y
            if not np.max(np.abs(y[:n_rb] - r[k])) <= bound:  # NaN too
                axis = int(np.argmax(np.abs(y[:n_rb] - r[k])))
                stopped = float(times[k])
                status = (
                    f"stopped at t = {stopped:.6g} s: the error of axis {axis} exceeds {bound:g}. The loop is unstable "
                    "or far from the set-point: check the controller at this position, delay and limits."
                )
                break
            if added is not None:
                y = y + added[k]
            if rounded:
                y = np.where(steps > 0.0, steps_or_one * np.round(y / steps_or_one), y)
            v[n_rb:] = y
            v[n_rb : 2 * n_rb] -= r[k]
            v[:n_rb] = -v[n_rb : 2 * n_rb]
            following = K[i] @ np.concatenate([xi, v])
            u = following[n_c:] + ahead[k]
            feedback[k] = following[n_c:]
            if path is not None:
                u, peak[k] = path.limited(k, u)
                if peak[k] > path.limit:
                    saturated[k] = True
                    following[waiting] = xi[waiting]
            sent[k + whole] = u
            xi = following[:n_c]
            x = plants.Phi @ x + plants.Gamma[i] @ sent[k : k + 2].ravel()
            if forces is not None:
                x += plants.Gamma_w[:, : forces.shape[1]] @ forces[k]
        if stopped is not None:
            break
    n = N if stopped is None else k + 1
    if np.any(saturated) and stopped is None:
        status = (
            f"completed, with limits reached in {np.count_nonzero(saturated)} of {N} samples, first at "
            f"t = {times[np.argmax(saturated)]:.6g} s"
        )
    arrays = {
        "times": times, "positions": p[:N], "setpoint": r, "error": r - y_all[:, :n_rb],
        "redundant": y_all[:, n_rb:], "inputs": sent[whole:], "feedback": feedback, "states": states,
        "peak_current": peak,
    }  # fmt: skip
    kept = {name: read_only(value[:n]) for name, value in arrays.items()}
    return Motion(**kept, saturated=read_only(saturated[:n], bool), stopped=stopped, status=status)


def _modal(plant: DecoupledPlant | LPVStateSpace | ModalPlant) -> ModalPlant:
    if isinstance(plant, ModalPlant):
        return plant
    system = plant.system if isinstance(plant, DecoupledPlant) else plant
    if not isinstance(system, LPVStateSpace):
        raise DomainError(
            f"plant is a {type(plant).__name__}, wanted a DecoupledPlant, an LPVStateSpace of modes or a ModalPlant."
        )
    return ModalPlant.of(system)


def _check_fit(plant: ModalPlant, controller: LPVStateSpace, trajectory: Trajectory) -> None:
    n_rb, n_out, n_p = plant.n_rb, plant.n_out, len(plant.box)
    if n_rb == 0 or n_rb > n_out:
        raise DimensionError(f"plant has {n_rb} rigid-body modes and {n_out} outputs, wanted 1 to as many outputs.")
    if controller.n_u != n_rb + n_out:
        raise DimensionError(
            f"controller has {controller.n_u} inputs, wanted {n_rb + n_out}: e ({n_rb}) and y ({n_out})."
        )
    if not n_rb <= controller.n_y <= plant.n_in:
        raise DimensionError(
            f"controller has {controller.n_y} outputs, wanted {n_rb} to {plant.n_in}: u_RB, and u_FM or not."
        )
    if trajectory.n_axes != n_rb:
        raise DimensionError(f"trajectory has {trajectory.n_axes} axes, wanted {n_rb}, the rigid axes of the plant.")
    if n_p > n_rb:
        raise DimensionError(f"plant has {n_p} scheduling coordinates and {n_rb} axes, wanted no more than axes.")
    box = controller.box
    if len(box) != n_p or np.any(plant.box[:, 0] < box[:, 0]) or np.any(plant.box[:, 1] > box[:, 1]):
        raise DomainError(
            f"controller has the box {box.tolist()}, wanted all of the plant's, {plant.box.tolist()}. "
            "Schedule it over the whole box."
        )


def _per_output(name: str, value: ArrayLike, n_out: int) -> Array:
    given = np.atleast_1d(finite_array(name, value))
    if given.shape not in ((1,), (n_out,)):
        raise DimensionError(f"{name} has shape {given.shape}, wanted one number or ({n_out},).")
    if np.any(given < 0.0):
        raise DomainError(f"{name} is {given.tolist()}, wanted 0 or more.")
    return np.asarray(np.broadcast_to(given, (n_out,)))


def _forces(disturbance: ArrayLike | None, N: int, n_modes: int) -> Array | None:
    if disturbance is None:
        return None
    given = finite_array("disturbance", disturbance, (None, None))
    if len(given) < N or not 1 <= given.shape[1] <= n_modes:
        raise DimensionError(
            f"disturbance has shape {given.shape}, wanted at least {N} samples of 1 to {n_modes} modes."
        )
    return given


def _distinct(p: Array, following: Array) -> tuple[Array, Array]:
    """Distinct pairs of a position and the following one, and which of them each sample has."""
    pairs = np.hstack([p, following])
    changed = np.append(True, np.any(np.diff(pairs, axis=0) != 0.0, axis=1))
    return pairs[changed], np.cumsum(changed) - 1
