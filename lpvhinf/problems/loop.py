r"""The control loop behind the paper's problems, written signal by signal.

::

                        w2 -> W_w2 --+                  +-- W_w3 <- w3
                                     v                  v
    e --> K_RB --> u_RB (-> W_z2 -> z2) --u1-->[ G~(p) ]<--+-- u_FM
    ^                                |            |        ^
    |                                +-->[ O(p) ]<+ y      |
    | -                                    ^  |            |
    +<--(+)<-- y                     u_FM -+  +-> -xi H(s)-+
         ^
         +-- W_w1 <- w1                         z1 = W_z1 e

Where the paper's figure is silent or not printed, its formula for M decides:

* w1 enters outside of G_Delta, behind the point where the observer takes y: the (1, 1) block is S alone.
* w2 enters at u_RB where the observer sees it: the (1, 2) block is S G_Delta(y, u_1).
* w3 is a force on the flexible modes. The plant feels it, the observer does not know of it: an observer
  that were told of its disturbance would ask nothing of L.

:math:`e = -(y + W_{w1} w_1)`, so that z = -M w as in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.controllers import band_pass, velocity_selection
from lpvhinf.errors import AssumptionError
from lpvhinf.problems.wiring import Signal, Wiring
from lpvhinf.shaping import ShapingFilters
from lpvhinf.statespace.lpv import LPVStateSpace

StateSpaceArrays = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class ObserverBranch:
    """What the flexible-mode loop adds to the plant: the model of O, the band-pass, and units of injection.

    Attributes
    ----------
    model : LPVStateSpace
        A_o, B_o, C_o(p), D_o(p), scaled like the plant.
    omega : (n_flex,) [rad/s]
        Frequencies of the controlled modes.
    Q : float
        Of the band-pass.
    injection : (n_o,) [rad/s]
        The observer's correction is diag(injection) L nu, so that L is of size one.
    """

    model: LPVStateSpace
    omega: Array
    Q: float
    injection: Array

    @property
    def n_flex(self) -> int:
        """Number of controlled modes."""
        return len(self.omega)


@dataclass(frozen=True, kw_only=True, eq=False)
class TunedParts:
    """The tuned part diag(K_RB, L, xi) at given parameters, in scaled units.

    Attributes
    ----------
    K_RB : (A, B, C, D) from (e, x_I) to u_RB
    L : (n_o, n_out), or None without an observer
    xi : (n_flex,), or None; positive values damp
    """

    K_RB: StateSpaceArrays
    L: Array | None = None
    xi: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """The parts that every problem is wired from; `wire` connects them.

    Attributes
    ----------
    plant : LPVStateSpace
        The scaled decoupled plant: inputs (u_1, u_2), outputs y, the first n_rb of them controlled.
    filters : ShapingFilters
    n_rb : int
    observer : ObserverBranch or None
    """

    plant: LPVStateSpace
    filters: ShapingFilters
    n_rb: int
    observer: ObserverBranch | None = None

    @property
    def n_in(self) -> int:
        """Number of the plant's flexible-mode inputs."""
        return self.plant.n_u - self.n_rb

    def wire(self, *, controller: TunedParts | None, weighted: bool, flexible_input: bool) -> LPVStateSpace:
        """Connect the loop.

        Parameters
        ----------
        controller : TunedParts or None
            None leaves the tuned part open: the inputs are then (w, v) with v = (u_RB, injection, u_FM) and
            the outputs (z, m) with m = (e, x_I, nu, band-passed velocities), v = diag(K_RB, L, -xi) m.
        weighted : bool
            With the shaping filters and z = (z1, z2), or without them and z = (e, u_RB, u_FM).
        flexible_input : bool
            Whether w = (w1, w2, w3) or only (w1, w2).

        Raises
        ------
        AssumptionError
            If K_RB has a feed-through, or the loop has an observer and L or xi is missing.
        """
        if controller is not None:
            self._check(controller)
        n_rb, n_flex, observer = self.n_rb, self.n_in, self.observer
        n_o = 0 if observer is None else observer.model.n_x
        n_fm = 0 if observer is None else n_flex
        n_w3 = n_flex if flexible_input else 0
        W_z2, W_w3 = self.filters.realize_W_z2(), self.filters.realize_W_w3()
        states = [("plant", self.plant.n_x), ("integral", n_rb)]
        if weighted:
            states += [("W_z2", n_rb)] + ([("W_w3", 2 * n_flex)] if n_w3 else [])
        if observer is not None:
            states += [("observer", n_o), ("band_pass", 2 * n_flex)]
        inputs = [("w1", n_rb), ("w2", n_rb), ("w3", n_w3)]
        if controller is None:
            inputs += [("u_RB", n_rb), ("injection", n_o), ("u_FM", n_fm)]
        else:
            states += [("K_RB", controller.K_RB[0].shape[0])]
        wiring = Wiring(self.plant.box, states=states, inputs=inputs)

        # forces: from controller states only, so that nothing is circular
        velocities = wiring.zero(0)
        if observer is not None:
            filter_ = band_pass(observer.omega, observer.Q)
            estimates = velocity_selection(n_rb, n_flex) @ wiring.state("observer")
            velocities = wiring.drive("band_pass", filter_, estimates)
        if controller is None:
            u_RB, u_FM = wiring.input("u_RB"), wiring.input("u_FM")
        else:
            u_RB = controller.K_RB[2] @ wiring.state("K_RB")
            u_FM = velocities if observer is None else -np.diag(np.asarray(controller.xi)) @ velocities
        seen = u_RB + wiring.input("w2")  # W_w2 = I
        force = self._flexible_force(wiring, u_FM, W_w3, weighted=weighted, flexible_input=flexible_input)

        x = wiring.state("plant")
        inputs_of_plant = wiring.stack(seen, force)
        wiring.set_derivative("plant", self.plant.A @ x + self.plant.B @ inputs_of_plant)
        y = self.plant.C @ x + self.plant.D @ inputs_of_plant
        rigid = y[slice(0, n_rb), slice(None)]  # further outputs are redundant sensors, for the observer only
        e = -(rigid + wiring.input("w1"))  # W_w1 = I
        integral = wiring.state("integral")
        wiring.set_derivative("integral", np.diag(2 * np.pi * self.filters.f_I) @ e)

        innovation = wiring.zero(0)
        if observer is not None:
            innovation = self._observe(wiring, wiring.stack(seen, u_FM), y, controller)
        if controller is not None:
            A, B, _, _ = controller.K_RB
            wiring.set_derivative("K_RB", A @ wiring.state("K_RB") + B @ wiring.stack(e, integral))

        if weighted:
            z1 = self.filters.K_s * np.eye(n_rb) @ (e + integral)
            outputs: Sequence[Signal] = [z1, wiring.drive("W_z2", W_z2, u_RB)]
        else:
            outputs = [e, u_RB, u_FM]
        if controller is None:
            outputs = [*outputs, e, integral, innovation, velocities]
        return wiring.read(outputs)

    def _check(self, controller: TunedParts) -> None:
        """Whether the tuned parts are those of this loop."""
        if np.any(controller.K_RB[3]):
            raise AssumptionError("K_RB has a feed-through, wanted a strictly proper one. Give it a low-pass filter.")
        if self.observer is not None and (controller.L is None or controller.xi is None):
            raise AssumptionError("the loop has an observer, but L or xi is None. Give both.")

    def _flexible_force(
        self, wiring: Wiring, u_FM: Signal, W_w3: StateSpaceArrays, *, weighted: bool, flexible_input: bool
    ) -> Signal:
        """The force at the plant's flexible-mode inputs: u_FM, if there is an observer, and w3."""
        force = wiring.zero(self.n_in) if self.observer is None else u_FM
        if flexible_input:
            w3 = wiring.input("w3")
            force = force + (wiring.drive("W_w3", W_w3, w3) if weighted else w3)
        return force

    def _observe(self, wiring: Wiring, u: Signal, y: Signal, controller: TunedParts | None) -> Signal:
        """Wire the observer's dynamics; returns the innovation nu = y - C_o x_o - D_o u."""
        assert self.observer is not None
        model, x = self.observer.model, wiring.state("observer")
        innovation = y - model.C @ x - model.D @ u
        if controller is None:
            injection = wiring.input("injection")
        else:
            injection = np.asarray(controller.L) @ innovation
        wiring.set_derivative("observer", model.A @ x + model.B @ u + np.diag(self.observer.injection) @ injection)
        return innovation
