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

That is the output-based observer in the six-block problem. An error-based observer O(p) takes -e and u_FM in place of
(u, y), and of y the redundant readings only, which hold no rigid-body motion. In the two-by-two problem there is no
disturbance of y; the force at u_1 is w1, through W_w1, and that on the flexible modes is w2, see
`lpvhinf.problems.places`.

Where the paper's figure is silent or not printed, its formulas for M decide:

* w1 of the six blocks enters outside of G_Delta, behind the point where the output-based observer takes y: the (1, 1)
  block is S alone. An error-based observer sees it in e.
* The force at u_1 enters where the output-based observer sees it: its block is S G_Delta(y, u_1). An error-based
  observer knows nothing of u_1.
* The force on the flexible modes is felt by the plant, and no observer knows of it: an observer that were told of its
  disturbance would ask nothing of L.

:math:`e = -(y + W_{w1} w_1)` or :math:`e = -y`, so that z = -M w as in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpvhinf.controllers import band_pass
from lpvhinf.errors import AssumptionError
from lpvhinf.problems.parts import ObserverBranch, TunedParts, is_zero
from lpvhinf.problems.places import SIX_BLOCK, Places, places
from lpvhinf.problems.wiring import Signal, Wiring
from lpvhinf.shaping import Filter, ShapingFilters
from lpvhinf.statespace.lpv import LPVStateSpace


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

    def wire(
        self, *, controller: TunedParts | None, weighted: bool, flexible_input: bool, problem: str = SIX_BLOCK
    ) -> LPVStateSpace:
        """Connect the loop.

        Parameters
        ----------
        controller : TunedParts or None
            None leaves the tuned part open: the inputs are then (w, v) with v = (u_RB, injection, u_FM) and
            the outputs (z, m) with m = (e, x_I, nu, band-passed velocities), v = diag(K_RB, L, -xi) m.
        weighted : bool
            With the shaping filters and z = (z1, z2), or without them and z = (e, u_RB, u_FM).
        flexible_input : bool
            Whether w holds the force on the flexible modes, its last part, or only what comes before.
        problem : "six-block" or "two-by-two"
            Which disturbances there are, and which filters weigh them: w = (disturbance of y, force at u_1, force on
            the modes), or without the first.

        Raises
        ------
        AssumptionError
            If K_RB has a feed-through, or the loop has an observer and L or xi is missing.
        DomainError
            If there is no such problem.
        """
        if controller is not None:
            self._check(controller)
        where, observer = places(problem, self.filters), self.observer
        wiring = self._signals(controller, where, weighted=weighted, flexible_input=flexible_input)

        def weigh(name: str, filter_: Filter, signal: Signal) -> Signal:
            return wiring.drive(name, filter_, signal) if weighted else signal

        # forces: from controller states only, so that nothing is circular
        velocities = wiring.zero(0)
        if observer is not None:
            estimates = observer.Psi @ wiring.state("observer")
            velocities = wiring.drive("band_pass", band_pass(observer.omega, observer.Q), estimates)
        if controller is None:
            u_RB, u_FM = wiring.input("u_RB"), wiring.input("u_FM")
        else:
            u_RB = controller.K_RB[2] @ wiring.state("K_RB")
            u_FM = velocities if observer is None else -(controller.K_FM @ velocities)
        u_1 = u_RB + weigh("W_force", where.force, wiring.input("force"))
        u_2 = wiring.zero(self.n_in) if observer is None else u_FM
        if flexible_input:
            u_2 = u_2 + weigh("W_flexible", where.flexible, wiring.input("flexible"))

        x, u = wiring.state("plant"), wiring.stack(u_1, u_2)
        wiring.set_derivative("plant", self.plant.A @ x + self.plant.B @ u)
        y = self.plant.C @ x + self.plant.D @ u
        e = -y[slice(0, self.n_rb), slice(None)]  # further outputs are redundant sensors, for the observer only
        if where.disturbs_output:
            e = e - wiring.input("disturbance")  # W_w1 = I
        integral = wiring.state("integral")
        wiring.set_derivative("integral", np.diag(2 * np.pi * self.filters.f_I) @ e)

        innovation = wiring.zero(0)
        if observer is not None:
            if observer.fed_by_error:
                redundant = y[slice(self.n_rb, None), slice(None)]
                known, measured = u_FM, wiring.stack(-e, redundant)
            else:
                known, measured = wiring.stack(u_1, u_FM), y
            innovation = self._observe(wiring, known, measured, controller)
        if controller is not None:
            A, B, _, _ = controller.K_RB
            wiring.set_derivative("K_RB", A @ wiring.state("K_RB") + B @ wiring.stack(e, integral))

        if weighted:
            z1 = where.error * np.eye(self.n_rb) @ (e + integral)
            outputs: Sequence[Signal] = [z1, wiring.drive("W_u_RB", where.u_RB, u_RB)]
        else:
            outputs = [e, u_RB, u_FM]
        if controller is None:
            outputs = [*outputs, e, integral, innovation, velocities]
        return wiring.read(outputs)

    def _signals(self, controller: TunedParts | None, where: Places, *, weighted: bool, flexible_input: bool) -> Wiring:
        """The states and inputs of the loop."""
        n_rb, n_flex, observer = self.n_rb, self.n_in, self.observer
        n_w3 = n_flex if flexible_input else 0
        states = [("plant", self.plant.n_x), ("integral", n_rb)]
        if weighted:
            states += [("W_u_RB", len(where.u_RB[0])), ("W_force", len(where.force[0]))]
            states += [("W_flexible", len(where.flexible[0]))] if flexible_input else []
        if observer is not None:
            states += [("observer", observer.model.n_x), ("band_pass", 2 * n_flex)]
        inputs = [("disturbance", n_rb)] if where.disturbs_output else []
        inputs += [("force", n_rb), ("flexible", n_w3)]
        if controller is not None:
            states += [("K_RB", controller.K_RB[0].shape[0])]
        else:
            n_o = 0 if observer is None else observer.model.n_x
            inputs += [("u_RB", n_rb), ("injection", n_o), ("u_FM", 0 if observer is None else n_flex)]
        return Wiring(self.plant.box, states=states, inputs=inputs)

    def _check(self, controller: TunedParts) -> None:
        """Whether the tuned parts are those of this loop."""
        if not is_zero(controller.K_RB[3]):
            raise AssumptionError("K_RB has a feed-through, wanted a strictly proper one. Give it a low-pass filter.")
        if self.observer is not None and (controller.L is None or controller.xi is None):
            raise AssumptionError("the loop has an observer, but L or xi is None. Give both.")

    def _observe(self, wiring: Wiring, u: Signal, y: Signal, controller: TunedParts | None) -> Signal:
        """Wire the observer's dynamics; returns the innovation nu = y - C_o x_o - D_o u."""
        assert self.observer is not None
        model, x = self.observer.model, wiring.state("observer")
        innovation = y - model.C @ x - model.D @ u
        if controller is None:
            injection = wiring.input("injection")
        else:
            assert controller.L is not None
            injection = controller.L @ innovation
        wiring.set_derivative("observer", model.A @ x + model.B @ u + np.diag(self.observer.injection) @ injection)
        return innovation
