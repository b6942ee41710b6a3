"""A finished co-design: its parameters in physical units, its controller and its closed loops over P."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lpvhinf.checks import Array, points_in_box
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.physical import PhysicalGains, physical_gains
from lpvhinf.codesign.specification import Specification
from lpvhinf.controllers import RigidBodyGains, RigidBodyStateSpace, band_pass
from lpvhinf.controllers.rigid_body import PARAMETERS
from lpvhinf.hinfstruct import Evaluations
from lpvhinf.problems import SIX_BLOCK
from lpvhinf.problems.wiring import Wiring
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.storage import write_arrays

KIND = "lpvhinf.Design"
AXES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """What `codesign` returns.

    Attributes
    ----------
    assembly : Assembly
        Plant, specification and architecture.
    parameters : (n_theta,)
        The tuned parameters theta.
    positions : (N, n_p) [m]
        Design positions, those added by the worst-position search included.
    gammas : (N,)
        Exact norms of M there, with the plant model itself.
    gamma_worst, worst_position
        The largest exact norm that the worst-position search found over P, and where.
    optimality : float
        Norm of the smallest convex combination of active gradients; small at a local minimum.
    status : str
        What the solver says of its end.
    seconds : float
        Time spent.
    evaluations : Evaluations
        Trials and exact norms of all rounds and searches, those of the design that it begins with included.
    """

    assembly: Assembly
    parameters: Array
    positions: Array
    gammas: Array
    gamma_worst: float
    worst_position: Array
    optimality: float
    status: str
    seconds: float
    evaluations: Evaluations

    @property
    def architecture(self) -> str:
        """The architecture: "rigid-body", "output-observer" or "error-observer"."""
        return self.assembly.architecture

    @property
    def problem(self) -> str:
        """The problem that it was tuned for: "six-block" (4-block without observer) or "two-by-two"."""
        assert self.assembly.problem_name is not None
        return self.assembly.problem_name

    @property
    def specification(self) -> Specification:
        """What was asked for."""
        return self.assembly.specification

    @property
    def gamma(self) -> float:
        """Largest exact norm of M over the design positions."""
        return float(np.max(self.gammas))

    @property
    def stabilizing(self) -> bool:
        """Whether every loop at a design position is Hurwitz."""
        return bool(np.all(np.isfinite(self.gammas)))

    def gains_at(self, p: Array) -> PhysicalGains:
        """The tuned gains in physical units at a position (n_p,), the same everywhere unless they are scheduled."""
        return physical_gains(self.assembly, self.parameters, points_in_box(p, self.assembly.plant.box)[0])

    @cached_property
    def _central(self) -> PhysicalGains:
        return physical_gains(self.assembly, self.parameters)

    @property
    def K_RB(self) -> RigidBodyGains | RigidBodyStateSpace:
        """The rigid-body controller in physical units: gains of PIDs and notches, or a state space per axis.

        Where it is scheduled, at the centre of P; so are L and xi. Elsewhere: `gains_at`.
        """
        return self._central.K_RB

    @property
    def L(self) -> Array | None:
        """The observer gain (n_o, n_out), from innovations [m, rad] to physical modal states; None without observer."""
        return self._central.L

    @property
    def xi(self) -> Array | None:
        """Gains of K_FM, (n_flex,) [N/sqrt(kg) per m sqrt(kg)/s = 1/s]; positive damps."""
        return self._central.xi

    @cached_property
    def controller(self) -> LPVStateSpace:
        """The controller from (e, y) [m, rad] to (u_RB, u_FM) [m/s^2, rad/s^2, N/sqrt(kg)].

        e = r - y_RB. The output-based observer is fed with all outputs y = (y_RB, redundant readings) and the
        controller's own outputs; the error-based one with -e, the redundant readings and u_FM, so that y_RB acts on
        nothing: e is then what is left of the error behind the feedforward.
        """
        assembly, tuned = self.assembly, self.assembly.tuned_parts(self.parameters)
        n_rb, scaling, observer = assembly.plant.n_rb, assembly.scaling, assembly.observer
        states = [("integral", n_rb), ("K_RB", tuned.K_RB[0].shape[0])]
        if observer is not None:
            states += [("observer", observer.model.n_x), ("band_pass", 2 * observer.n_flex)]
        wiring = Wiring(assembly.plant.box, states=states, inputs=[("e", n_rb), ("y", len(scaling.output))])
        e, y = np.diag(scaling.output[:n_rb]) @ wiring.input("e"), np.diag(scaling.output) @ wiring.input("y")
        wiring.set_derivative("integral", np.diag(2 * np.pi * assembly.filters.f_I) @ e)
        u_RB = wiring.drive("K_RB", tuned.K_RB, wiring.stack(e, wiring.state("integral")))
        outputs = [np.diag(scaling.input[:n_rb]) @ u_RB]
        if observer is not None:
            assert tuned.L is not None
            x, model = wiring.state("observer"), observer.model
            velocities = wiring.drive("band_pass", band_pass(observer.omega, observer.Q), observer.Psi @ x)
            u_FM = -(tuned.K_FM @ velocities)
            u, measured = wiring.stack(u_RB, u_FM), y
            if observer.fed_by_error:
                u, measured = u_FM, wiring.stack(-e, y[slice(n_rb, None), slice(None)])
            correction = tuned.L @ (measured - model.C @ x - model.D @ u)
            wiring.set_derivative("observer", model.A @ x + model.B @ u + np.diag(observer.injection) @ correction)
            outputs.append(np.diag(scaling.input[n_rb:]) @ u_FM)
        return wiring.read(outputs)

    @cached_property
    def closed_loop(self) -> LPVStateSpace:
        """The unweighted loop in physical units, polynomial in p.

        Inputs, whatever the problem: an output disturbance w1 [m, rad], an acceleration w2 at u_RB [m/s^2, rad/s^2]
        that the output-based observer sees, a modal force w3 [N/sqrt(kg)]; outputs: e [m, rad], u_RB [m/s^2,
        rad/s^2], u_FM [N/sqrt(kg)].
        """
        scaling, n_rb = self.assembly.scaling, self.assembly.plant.n_rb
        loop = self.assembly.loop.wire(
            controller=self.assembly.tuned_parts(self.parameters), weighted=False, flexible_input=True
        )
        u_FM = scaling.input[n_rb:] if self.assembly.observer is not None else scaling.input[n_rb:][:0]
        left = np.concatenate([1.0 / scaling.output[:n_rb], scaling.input[:n_rb], u_FM])
        right = np.concatenate([scaling.output[:n_rb], 1.0 / scaling.input])
        rows, columns = np.diag(left[: loop.n_y]), np.diag(right)
        return LPVStateSpace(loop.A, loop.B @ columns, rows @ loop.C, rows @ loop.D @ columns)

    @cached_property
    def performance_loop(self) -> LPVStateSpace:
        """The weighted loop from w to z = -M w, integrators absorbed, polynomial in p; Hurwitz where stable."""
        return self.assembly.loop.wire(
            controller=self.assembly.tuned_parts(self.parameters),
            weighted=True,
            flexible_input=self.assembly.observer is not None,
            problem=self.problem,
        )

    def frozen(
        self, points: Array, *, weighted: bool = False, problem: str | None = None
    ) -> list[tuple[Array, Array, Array, Array]]:
        """Closed loops (A, B, C, D), scaled units, with the plant model itself at positions (N, n_p).

        Without filters the inputs are (w1, w2, w3) of the six blocks, the outputs (e, u_RB, u_FM). If `weighted` they
        are w, with the force on the modes as its last part in every architecture, and (z1, z2) of a problem, by
        default the one that the design was tuned for.
        """
        if problem is None:
            problem = self.problem if weighted else SIX_BLOCK
        centre = np.mean(self.assembly.plant.box, axis=1)[None]
        out = []
        for p, loop in zip(points, self.assembly.frozen_loops(points), strict=True):
            tuned = self.assembly.tuned_parts(self.parameters, p)
            system = loop.wire(controller=tuned, weighted=weighted, flexible_input=True, problem=problem)
            A, B, C, D = system.sample(centre)
            out.append((A[0], B[0], C[0], D[0]))
        return out

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a folder: parameters and figures of the design, plant, controller and closed loops as arrays."""
        folder = Path(path)
        arrays: dict[str, Any] = {
            "parameters": self.parameters,
            "positions": self.positions,
            "gammas": self.gammas,
            "gamma_worst": self.gamma_worst,
            "worst_position": self.worst_position,
            "optimality": self.optimality,
            "status": np.array(self.status),
            "seconds": self.seconds,
            "trials": self.evaluations.trials,
            "exact_norms": self.evaluations.exact,
            "every_model_norms": self.evaluations.every_model,
            "architecture": np.array(self.architecture),
            "problem": np.array(self.problem),
            "f_bw": self.assembly.scaling.f_bw,
            "scaling_output": self.assembly.scaling.output,
            "scaling_input": self.assembly.scaling.input,
            "scaling_state": self.assembly.scaling.state,
        }
        parts = self.K_RB.arrays()
        if isinstance(self.K_RB, RigidBodyGains):
            arrays["K_RB"] = np.stack([parts.pop(name) for name in PARAMETERS])
        arrays |= {f"K_RB_{name}": value for name, value in parts.items()}  # notches, or state spaces
        if self.L is not None and self.xi is not None:
            arrays |= {"L": self.L, "xi": self.xi}  # at the centre of P where scheduled, as K_RB is
        arrays |= {f"schedule_{name}": degree for name, degree in self.assembly.layout.degrees.items()}
        self.assembly.plant.system.save(folder / "plant.npz")
        self.controller.save(folder / "controller.npz")
        self.closed_loop.save(folder / "closed_loop.npz")
        self.performance_loop.save(folder / "performance_loop.npz")
        write_arrays(folder / "design.npz", KIND, arrays)  # last: a folder with it is complete

    def report(self) -> str:
        """The design in a few lines of text."""
        f_bw = self.assembly.scaling.f_bw
        names = AXES if len(f_bw) == len(AXES) else tuple(f"axis {i + 1}" for i in range(len(f_bw)))
        lines = [
            f"{self.architecture} design for {np.unique(f_bw).tolist()} Hz at {len(self.positions)} positions, "
            f"{self.problem} problem",
            f"  gamma            {self.gamma:.3f} at the design positions, {self.gamma_worst:.3f} over P (searched)",
            f"  worst position   {(1e3 * self.worst_position).round(1).tolist()} mm",
            *self.K_RB.table(names),
        ]
        if self.xi is not None:
            pairs = zip(self.assembly.omega_flex, self.xi, strict=True)
            lines += [f"  mode {w / (2 * np.pi):.1f} Hz: xi = {xi:.1f} 1/s" for w, xi in pairs]
        if degrees := self.assembly.layout.degrees:
            moving = ", ".join(f"{name} of degree {degree}" for name, degree in degrees.items())
            lines.append(f"  polynomials of p: {moving}; the values above are those at the centre of P")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Design({self.architecture!r}, gamma={self.gamma:.4g}, gamma_worst={self.gamma_worst:.4g})"
