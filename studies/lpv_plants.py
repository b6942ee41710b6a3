"""The generalized plants of the LPV study: one weighted problem for designs of any structure, and its truth.

They come from the six-block problem of the co-design, with five changes that hold for every design compared:

* the integrator of W_z1 leaks slowly: no controller of full order could detect it from y;
* u_FM is weighted by a small gain, which the six blocks leave free;
* the redundant readings carry noise, so that D21 has full rank;
* a high-pass W_a weighs (u_RB, u_FM): with the disturbance of y it makes an additive uncertainty of discarded modes;
* the observer is told of no disturbance: that of the six blocks sees the force at u_1, and y without its disturbance,
  which other controllers could not, and which would hide its part of the loop from the uncertainty.

The design plant is the model that the observer of the co-design has: rigid-body and preserved modes, with the static
compliance D_o(p) of all others. A controller of full order reads y - D_o(p) u and gives (u_RB, u_FM); that changes
nothing of what can be reached, and D22 is zero. B2 depends on p through the compliance alone, as it reaches the
integrator; C1, D12 and C2 are scheduled. The truth has all modes of the plant model, not a polynomial.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from benchmarks.hinfstruct.out_of_plane import out_of_plane
from lpvhinf.checks import Array
from lpvhinf.codesign import Specification
from lpvhinf.codesign.assembly import OUTPUT_OBSERVER, Assembly
from lpvhinf.decoupling import decouple
from lpvhinf.plant.mmpa import benchmark
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.problems import Loop, six_block
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

Indices = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """The weighted problem around the design plant, and around the plant with all its modes.

    Attributes
    ----------
    assembly : Assembly
        Of the output-based observer.
    leak : float
        Rate of the leaking integrator over 2 pi f_I.
    u_FM_weight : float
        Weight on u_FM in scaled units.
    noise : float
        Of the redundant readings, in scaled units.
    uncertainty, f_uncertainty : float
        Of W_a = uncertainty s / (s + 2 pi f_uncertainty) on (u_RB, u_FM), in scaled units and Hz.
    """

    assembly: Assembly
    leak: float
    u_FM_weight: float
    noise: float
    uncertainty: float
    f_uncertainty: float

    @property
    def box(self) -> Array:
        """Positions, (2, 2) [m]."""
        return self.assembly.plant.box

    @property
    def model(self) -> LPVStateSpace:
        """The scaled design plant from (u_RB, u_FM) to y."""
        assert self.assembly.observer is not None
        return self.assembly.observer.model

    @cached_property
    def _known(self) -> LPVGeneralizedPlant:
        assembly = self.assembly
        loop = Loop(plant=self.model, filters=assembly.filters, n_rb=assembly.plant.n_rb, observer=assembly.observer)
        return six_block(loop)

    def structured(self, points: Array, *, truth: bool = False) -> list[GeneralizedPlant]:
        """What is left open for diag(K_RB, L, -xi), with the observer's model in the plant, at positions (N, 2)."""
        plants = self.assembly.generalized_plants(points) if truth else self._known.sample(points)
        return [self._changed(plant, D) for plant, D in zip(plants, self.model.D.sample(points), strict=True)]

    def rigid_body(self, points: Array, *, truth: bool = False) -> list[GeneralizedPlant]:
        """What is left open for K_RB alone, from (e, x_I) to u_RB."""
        n_rb = self.assembly.plant.n_rb
        return [
            self._parts(plant, np.arange(n_rb), np.arange(2 * n_rb)) for plant in self.structured(points, truth=truth)
        ]

    def full_order(self, points: Array, *, truth: bool = False, compensated: bool = True) -> list[GeneralizedPlant]:
        """What is left open for a controller from (e, redundant readings) to (u_RB, u_FM).

        `compensated`: D_o(p) u is subtracted from what the controller reads.
        """
        plants = self.structured(points, truth=truth)
        return self._opened(plants, self.model.D.sample(points), compensated)

    def at(self, p: Array) -> GeneralizedPlant:
        """The design plant of full order at one position; D22 is zero."""
        plant = self.full_order(np.reshape(p, (1, -1)))[0]
        return _with_D22(plant, np.zeros_like(plant.D22))  # zero but for round-off

    @cached_property
    def without_compliance(self) -> LPVGeneralizedPlant:
        """The design plant of full order without compliance: B2, D12 and D21 are constant, C2 alone moves."""
        n_rb, n_out, n_u, model = self.assembly.plant.n_rb, self.assembly.plant.n_out, self.model.n_u, self.model
        still = LPVStateSpace(model.A, model.B, model.C, ChebyshevMatrix(np.zeros((n_out, n_u)), self.box))
        assert self.assembly.observer is not None
        observer = dataclasses.replace(self.assembly.observer, model=still)
        known = six_block(Loop(plant=still, filters=self.assembly.filters, n_rb=n_rb, observer=observer))

        def sample(points: Array) -> tuple[Array, Array, Array, Array]:
            nothing = np.zeros((len(points), n_out, n_u))
            plants = [self._changed(plant, nothing[0]) for plant in known.sample(points)]
            parts = self._opened(plants, nothing, True)
            return (
                np.stack([P.A for P in parts]),
                np.stack([np.hstack([P.B1, P.B2]) for P in parts]),
                np.stack([np.vstack([P.C1, P.C2]) for P in parts]),
                np.stack([np.block([[P.D11, P.D12], [P.D21, 0.0 * P.D22]]) for P in parts]),
            )

        fitted = LPVStateSpace.interpolate(sample, box=self.box, degree=self.assembly.plant.degree).system
        return LPVGeneralizedPlant(LPVStateSpace(*map(_settled, fitted.matrices)), n_u=n_u, n_y=n_out)

    def _opened(self, plants: list[GeneralizedPlant], D_o: Array, compensated: bool) -> list[GeneralizedPlant]:
        """Parts of changed problems for a controller of full order."""
        n_rb, n_flex, n_out = self.assembly.plant.n_rb, self.assembly.plant.n_flex, self.assembly.plant.n_out
        inputs = np.r_[np.arange(n_rb), n_rb + self.model.n_x + np.arange(n_flex)]
        outputs = np.r_[np.arange(n_rb), 3 * n_rb + np.arange(n_out - n_rb)]  # of (e, x_I, nu, ...): e, redundant nu
        found = []
        for plant, D in zip(plants, D_o, strict=True):
            part = self._parts(plant, inputs, outputs)
            D22 = part.D22.copy()
            if compensated:  # e holds -D u, the redundant nu is y - D_o u
                D22[:n_rb] += D[:n_rb]
            else:
                D22[n_rb:] += D[n_rb:]
            found.append(_with_D22(part, D22))
        return found

    def performance(self, plant: GeneralizedPlant) -> GeneralizedPlant:
        """A changed problem without the outputs of W_a: what counts once the discarded modes are in the plant."""
        z = slice(0, plant.n_z - self.model.n_u)
        return GeneralizedPlant(
            plant.A, plant.B1, plant.B2, plant.C1[z], plant.C2, plant.D11[z], plant.D12[z], plant.D21, plant.D22
        )

    def _changed(self, plant: GeneralizedPlant, D_o: Array) -> GeneralizedPlant:
        """The six-block plant with the leak, further weights, noise, and an observer that knows no disturbance."""
        n_rb, n_flex, n_red = self.assembly.plant.n_rb, self.assembly.plant.n_flex, self._n_red
        n_u, n_z, n_x = n_rb + n_flex, plant.n_z, plant.n_x
        A = plant.A.copy()
        first = self._n_plant(plant)
        integral = np.arange(first, first + n_rb)
        A[integral, integral] -= self.leak * 2 * np.pi * self.assembly.filters.f_I
        forces = np.zeros((n_u, plant.n_u))  # (u_RB, u_FM) among (u_RB, injection, u_FM)
        forces[:n_rb, :n_rb] = np.eye(n_rb)
        forces[n_rb:, plant.n_u - n_flex :] = np.eye(n_flex)
        # W_a: the last states, driven by u
        pole = 2 * np.pi * self.f_uncertainty
        n_observer = self.model.n_x
        observer = slice(n_x - self._n_added, n_x - self._n_added + n_observer)
        force, nu = slice(n_rb, 2 * n_rb), slice(2 * n_rb, 2 * n_rb + len(D_o))  # w: of y, force at u_1, on modes
        B1, D21 = plant.B1.copy(), plant.D21.copy()
        B1[observer, force] = 0.0
        D21[nu, force] += D_o[:, :n_rb]  # nu held y - D_o (u_RB + force)
        D21[2 * n_rb : 3 * n_rb, :n_rb] += np.eye(n_rb)  # it reads -e, not an undisturbed y
        noise = np.zeros((plant.n_y, n_red))
        noise[3 * n_rb : 3 * n_rb + n_red] = self.noise * np.eye(n_red)
        D11 = np.zeros((n_z + n_flex + n_u, plant.n_w + n_red))
        D11[:n_z, : plant.n_w] = plant.D11
        C1 = np.zeros((n_z + n_flex + n_u, n_x + n_u))
        C1[:n_z, :n_x], C1[n_z + n_flex :, n_x:] = plant.C1, -self.uncertainty * np.eye(n_u)
        D12 = np.vstack([plant.D12, self.u_FM_weight * forces[n_rb:], self.uncertainty * forces])
        return GeneralizedPlant(
            scipy.linalg.block_diag(A, -pole * np.eye(n_u)),
            np.pad(B1, ((0, n_u), (0, n_red))),
            np.vstack([plant.B2, pole * forces]),
            C1,
            np.pad(plant.C2, ((0, 0), (0, n_u))),
            D11,
            D12,
            np.hstack([D21, noise]),
            plant.D22,
        )

    @property
    def _n_red(self) -> int:
        return self.assembly.plant.n_out - self.assembly.plant.n_rb

    @property
    def _n_added(self) -> int:
        """States of the observer and its band-pass, which a controller of full order does without."""
        return self.model.n_x + 2 * self.assembly.plant.n_flex

    def _n_plant(self, plant: GeneralizedPlant) -> int:
        """States of the plant inside a six-block problem, those of W_a not yet added."""
        return plant.n_x - self._n_filters - self._n_added

    @property
    def _n_filters(self) -> int:
        """States of the integrator, W_z2 and W_w3."""
        filters = self.assembly.filters
        return len(filters.f_I) + len(filters.realize_W_z2()[0]) + len(filters.realize_W_w3()[0])

    def _parts(self, plant: GeneralizedPlant, inputs: Indices, outputs: Indices) -> GeneralizedPlant:
        """Some control inputs and measurements of a changed problem, without observer and band-pass."""
        last = plant.n_x - self.assembly.plant.n_rb - self.assembly.plant.n_flex  # W_a begins
        x = np.r_[np.arange(last - self._n_added), np.arange(last, plant.n_x)]
        return GeneralizedPlant(
            plant.A[np.ix_(x, x)],
            plant.B1[x],
            plant.B2[x][:, inputs],
            plant.C1[:, x],
            plant.C2[outputs][:, x],
            plant.D11,
            plant.D12[:, inputs],
            plant.D21[outputs],
            plant.D22[np.ix_(outputs, inputs)],
        )


def _with_D22(plant: GeneralizedPlant, D22: Array) -> GeneralizedPlant:
    return GeneralizedPlant(plant.A, plant.B1, plant.B2, plant.C1, plant.C2, plant.D11, plant.D12, plant.D21, D22)


def _settled(matrix: ChebyshevMatrix) -> ChebyshevMatrix:
    """Entries that move by round-off only are constant: polytopes ask for it exactly."""
    coefficients = matrix.coefficients.copy()
    flat = coefficients.reshape(-1, *matrix.shape)
    still = np.sum(np.abs(flat[1:]), axis=0) <= 1e-9 * np.max(np.abs(flat))
    flat[1:, still] = 0.0
    return ChebyshevMatrix(flat.reshape(coefficients.shape), matrix.box)


@lru_cache(maxsize=1)
def build(
    *,
    f_bw: float,
    epsilon: float,
    n_flex: int,
    n_plant_modes: int,
    degree: int,
    magnetics: str,
    leak: float,
    u_FM_weight: float,
    noise: float,
    uncertainty: float,
    f_uncertainty: float,
) -> Problem:
    """The problem of the out-of-plane axes (z, rx, ry) of the planar actuator."""
    machine = benchmark(n_flex=n_plant_modes, magnetics=magnetics)
    plant = decouple(out_of_plane(machine), n_flex=n_flex, degree=degree, weight=machine.coil_weights)
    specification = Specification(f_bw=f_bw, epsilon=epsilon)
    assembly = Assembly(plant=plant, specification=specification, architecture=OUTPUT_OBSERVER)
    return Problem(
        assembly=assembly,
        leak=leak,
        u_FM_weight=u_FM_weight,
        noise=noise,
        uncertainty=uncertainty,
        f_uncertainty=f_uncertainty,
    )
