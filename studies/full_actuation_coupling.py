"""How much the flexible-mode loop and the rigid-body loop feel of each other, measured on a finished design."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign import Design
from lpvhinf.codesign.measures import mode_damping
from lpvhinf.codesign.positions import norms_at
from lpvhinf.hinfstruct.response import Response

BAND = (0.1, 2.0)  # of the target bandwidth: where a coupling disturbs the rigid-body loop
N_BAND, N_MODE = 60, 41


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopCoupling:
    r"""Coupling of the two loops at N positions and n_omega frequencies, K_RB open.

    Attributes
    ----------
    omega : (n_omega,) [rad/s]
    plant_change : (N, n_omega)
        :math:`\bar\sigma((G_\Delta - G) G^{-1})`: how much the flexible-mode loop changes the rigid-body plant that
        K_RB sees, relative and in scaled units. G is the plant, G_Delta the plant with observer and K_FM.
    reaction : (N, n_omega)
        Largest singular value of the transfer from u_RB to u_FM, both mass-normalised: what the flexible-mode loop does
        while the rigid-body loop moves the mover.
    band : (n_omega,) of bool
        Frequencies from a tenth to twice the target bandwidth.
    """

    omega: Array
    plant_change: Array
    reaction: Array
    band: np.ndarray

    @property
    def change_in_band(self) -> Array:
        """Largest plant change in the band of the rigid-body loop at every position, (N,)."""
        return np.asarray(np.max(self.plant_change[:, self.band], axis=1))

    @property
    def reaction_in_band(self) -> Array:
        """Largest reaction in that band at every position, (N,)."""
        return np.asarray(np.max(self.reaction[:, self.band], axis=1))


def loop_coupling(design: Design, points: Array) -> LoopCoupling:
    """Measure the coupling at positions (N, n_p), with the plant model itself.

    With a disturbance w_2 at the rigid-body inputs the closed loop gives e = -G_Delta u and u_FM = F u for the total
    input u = u_RB + w_2: dividing by u opens K_RB, without a model of the loop beside the one of the design.
    """
    assembly = design.assembly
    n_rb = assembly.plant.n_rb
    omega, band = frequencies(design)
    S, scale = assembly.plant.known_modal.rigid_body_scaling, assembly.scaling.input
    centre = np.mean(assembly.plant.box, axis=1)[None]
    change, reaction = np.empty((len(points), len(omega))), np.empty((len(points), len(omega)))
    for k, ((A, B, C, D), system) in enumerate(zip(design.frozen(points), assembly.plant.frozen(points), strict=True)):
        w2 = slice(n_rb, 2 * n_rb)
        T = Response(A, B[:, w2], C, D[:, w2]).at(omega)
        total = np.linalg.inv(np.eye(n_rb) + T[:, n_rb : 2 * n_rb])
        seen, modal = -T[:, :n_rb] @ total, T[:, 2 * n_rb :] @ total
        a, b, c, d = (m[0] for m in assembly.plant_scaling.apply(system).sample(centre))
        alone = Response(a, b[:, :n_rb], c[:n_rb], d[:n_rb, :n_rb]).at(omega)
        difference = (seen - alone) @ np.linalg.inv(alone)
        change[k] = np.linalg.svd(difference, compute_uv=False)[:, 0]
        # physical units, and then a unit of force on the mass-normalised rigid modes
        force = scale[n_rb:, None] * modal / scale[:n_rb] @ S
        reaction[k] = np.linalg.svd(force, compute_uv=False)[:, 0]
    return LoopCoupling(omega=omega, plant_change=change, reaction=reaction, band=band)


def frequencies(design: Design) -> tuple[Array, np.ndarray]:
    """Frequencies [rad/s] and which of them lie in the band of the rigid-body loop."""
    f_bw = design.assembly.scaling.f_bw
    low, high = BAND[0] * 2 * np.pi * np.min(f_bw), BAND[1] * 2 * np.pi * np.max(f_bw)
    around = design.assembly.omega_flex[:, None] * np.linspace(0.8, 1.25, N_MODE)
    omega = np.unique(np.concatenate([np.geomspace(low, high, N_BAND), around.ravel()]))
    return omega, (omega >= low) & (omega <= high)


def with_Q(design: Design, Q: float) -> Design:
    """The same K_RB, L and xi with another band-pass; its norms are those of the new loop."""
    specification = dataclasses.replace(design.specification, Q=Q)
    assembly = dataclasses.replace(design.assembly, specification=specification)
    gammas = norms_at(assembly, np.asarray(design.parameters), np.asarray(design.positions))
    worst = int(np.argmax(gammas))
    return dataclasses.replace(
        design,
        assembly=assembly,
        gammas=gammas,
        gamma_worst=float(gammas[worst]),
        worst_position=design.positions[worst],
        optimality=float("nan"),
        status="not tuned for this Q",
    )


def damping(design: Design, points: Array) -> Array:
    """Damping ratios of the controlled modes at positions (N, n_p), (N, n_flex)."""
    return np.array([mode_damping(design, A)[0] for A, _, _, _ in design.frozen(points)])
