"""The paper's loop once more, in complex numbers at one frequency: the reference for the generalized plants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lpvhinf.checks import Array
from lpvhinf.codesign.assembly import Assembly
from lpvhinf.codesign.specification import Specification
from lpvhinf.decoupling import DecoupledPlant, decouple
from lpvhinf.fitting import interpolate
from lpvhinf.plant import ModalModel
from lpvhinf.plant.mmpa import MMPA

SMALL = Specification(f_bw=[12.0, 15.0], expected_error=[2e-6, 5e-5], epsilon=0.05, Q=0.8)
BENCHMARK = Specification(f_bw=[30.0, 30.0, 40.0, 45.0, 40.0, 35.0], Q=1.3)
Complex = NDArray[np.complex128]
PARAMETERS = ("k", "f_i", "f_d", "f_lp", "zeta")


@dataclass(frozen=True, kw_only=True, eq=False)
class Tuned:
    """diag(K_RB, L, xi) by its numbers: the five of K_RB for every axis, L and xi in scaled units."""

    rigid: dict[str, Array]
    L: Array
    xi: Array

    @property
    def theta(self) -> Array:
        """As the parameters of the assembly's structure."""
        rigid = np.log(np.stack([self.rigid[name] for name in PARAMETERS], axis=1)).ravel()
        return np.concatenate([rigid, self.L.ravel(), -self.xi])


def random_tuned(assembly: Assembly, seed: int = 0, size: float = 1.0) -> Tuned:
    """Any parameters, stabilising or not."""
    rng = np.random.default_rng(seed)
    n_rb, n_flex, n_out = assembly.plant.n_rb, assembly.plant.n_flex, assembly.plant.n_out
    n_o = 2 * (n_flex if assembly.architecture == "error-observer" else n_rb + n_flex)
    f = assembly.specification.bandwidths(n_rb)
    centre = {"k": 0.3 + 0 * f, "f_i": f / 5, "f_d": f / 3, "f_lp": 4 * f, "zeta": 0.7 + 0 * f}
    return Tuned(
        rigid={name: value * np.exp(0.2 * rng.standard_normal(n_rb)) for name, value in centre.items()},
        L=size * rng.standard_normal((n_o, n_out)),
        xi=size * rng.uniform(0.2, 0.6, n_flex),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Transfer matrices of the paper's formulas at s, at one position.

    Attributes
    ----------
    B, C, D : (n_modes - n_rb, n_in), (n_out, n_modes - n_rb), (n_out, n_in)
        Gains of the flexible modes and static compliance of the decoupled plant, in physical units.
    C_o, D_o : (n_out, n_flex), (n_out, n_in)
        What the observer knows of them.
    """

    assembly: Assembly
    B: Array
    C: Array
    D: Array
    C_o: Array
    D_o: Array

    @property
    def errors(self) -> Array:
        """Expected errors; redundant sensors share the smallest one, (n_out,)."""
        plant = self.assembly.plant
        errors = self.assembly.specification.errors(plant.n_rb)
        return np.concatenate([errors, np.full(plant.n_out - plant.n_rb, np.min(errors))])

    def plant(self, s: complex) -> Complex:
        """G~(s), scaled, from modal sums; with the loop's delay behind it."""
        plant, wanted = self.assembly.plant, self.assembly.specification
        n_rb = plant.n_rb
        G = self.D.astype(complex)
        G[:n_rb, :n_rb] += np.eye(n_rb) / s**2
        for b, c, w, z in zip(self.B, self.C.T, plant.omega[n_rb:], plant.zeta[n_rb:], strict=True):
            G = G + np.outer(c, b) / (s**2 + 2 * z * w * s + w**2)
        x = s * wanted.delay
        pade = (1 - x / 2 + x**2 / 12) / (1 + x / 2 + x**2 / 12)
        units = self.assembly.scaling.input
        return np.asarray(pade * G * units / self.errors[:, None])

    def observer(self, s: complex, L: Array) -> tuple[Complex, Complex]:
        """O(s) from u and from y to the modal velocities, computed in physical states and scaled at the end."""
        plant, branch = self.assembly.plant, self.assembly.observer
        assert branch is not None
        n_rb, n_flex, n_kept = plant.n_rb, plant.n_flex, plant.n_rb + plant.n_flex
        A, B = np.zeros((2 * n_kept, 2 * n_kept)), np.zeros((2 * n_kept, n_kept))
        C = np.zeros((plant.n_out, 2 * n_kept))
        for i in range(n_kept):
            w, z = plant.omega[i], plant.zeta[i]
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2), -2 * z * w]]
            B[2 * i + 1, i] = 1.0
            C[:, 2 * i] = np.eye(plant.n_out)[i] if i < n_rb else self.C_o[:, i - n_rb]
        state = self.assembly.scaling.state[: 2 * n_kept]
        gain = state[:, None] * branch.injection[:, None] * L / self.errors  # physical L
        inverse = np.linalg.inv(s * np.eye(2 * n_kept) - A + gain @ C)
        velocities = 2 * (n_rb + np.arange(n_flex)) + 1
        from_u = inverse @ (B - gain @ self.D_o) * self.assembly.scaling.input
        from_y = inverse @ gain * self.errors
        return from_u[velocities] / state[velocities, None], from_y[velocities] / state[velocities, None]

    def K_FM(self, s: complex, tuned: Tuned) -> Complex:
        """Eq. 11."""
        plant, Q = self.assembly.plant, self.assembly.specification.Q
        w = plant.omega[plant.n_rb : plant.n_rb + plant.n_flex]
        return np.diag(tuned.xi * (w / Q * s) / (s**2 + w / Q * s + w**2))

    def augmented(self, s: complex, tuned: Tuned) -> tuple[Complex, Complex, Complex, Complex]:
        """G_Delta from u_1 and u_2 to the controlled outputs, and the ways from them to u_FM."""
        plant, K_FM = self.assembly.plant, self.K_FM(s, tuned)
        n_rb = plant.n_rb
        G, (O_u, O_y) = self.plant(s), self.observer(s, tuned.L)
        G_1, G_2, O_1, O_2 = G[:, :n_rb], G[:, n_rb:], O_u[:, :n_rb], O_u[:, n_rb:]
        # u_FM = -K_FM (O_1 u_1 + O_2 u_FM + O_y y), y = G_1 u_1 + G_2 (u_FM + u_2)
        loop = np.eye(plant.n_flex) + K_FM @ (O_2 + O_y @ G_2)
        U_1 = np.asarray(-np.linalg.solve(loop, K_FM @ (O_1 + O_y @ G_1)), dtype=complex)
        U_2 = np.asarray(-np.linalg.solve(loop, K_FM @ O_y @ G_2), dtype=complex)
        return (G_1 + G_2 @ U_1)[:n_rb], (G_2 + G_2 @ U_2)[:n_rb], U_1, U_2

    def K_RB(self, s: complex, tuned: Tuned) -> Complex:
        """The PID with low-pass, scaled."""
        k, f_i, f_d, f_lp, zeta = (tuned.rigid[name] for name in PARAMETERS)
        x = s / (2 * np.pi * f_lp)
        return np.diag(k * (1 + 2 * np.pi * f_i / s) * (1 + s / (2 * np.pi * f_d)) / (x**2 + 2 * zeta * x + 1))

    def error_observer(self, s: complex, L: Array) -> tuple[Complex, Complex]:
        """O(s) from u_FM and from (y_flex, y_red) to the modal velocities, in physical states and scaled at the end."""
        plant, branch = self.assembly.plant, self.assembly.observer
        assert branch is not None
        n_rb, n_flex = plant.n_rb, plant.n_flex
        A, B, C = (
            np.zeros((2 * n_flex, 2 * n_flex)),
            np.zeros((2 * n_flex, n_flex)),
            np.zeros((plant.n_out, 2 * n_flex)),
        )
        for i in range(n_flex):
            w, z = plant.omega[n_rb + i], plant.zeta[n_rb + i]
            A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2), -2 * z * w]]
            B[2 * i + 1, i] = 1.0
            C[:, 2 * i] = self.C_o[:, i]
        state = self.assembly.scaling.state[2 * n_rb : 2 * (n_rb + n_flex)]
        gain = state[:, None] * branch.injection[:, None] * L / self.errors  # physical L
        inverse = np.linalg.inv(s * np.eye(2 * n_flex) - A + gain @ C)[1::2]
        from_u = inverse @ (B - gain @ self.D_o[:, n_rb:]) * self.assembly.scaling.input[n_rb:]
        from_y = inverse @ gain * self.errors
        return from_u / state[1::2, None], from_y / state[1::2, None]

    def by_error(self, s: complex, tuned: Tuned) -> tuple[Complex, Complex, Complex]:
        """G_Delta from u_1 and u_2 to the controlled outputs, redundant readings closed over the observer, and Sigma.

        u_FM = Sigma e with e = -y_flex, and velocities that the force opposes.
        """
        plant, K_FM = self.assembly.plant, self.K_FM(s, tuned)
        n_rb, one = plant.n_rb, np.eye(plant.n_flex)
        G, (O_u, O_y) = self.plant(s), self.error_observer(s, tuned.L)
        G_1, G_2, R_1, R_2 = G[:n_rb, :n_rb], G[:n_rb, n_rb:], G[n_rb:, :n_rb], G[n_rb:, n_rb:]
        O_e, O_r = -O_y[:, :n_rb], O_y[:, n_rb:]
        Sigma = -np.linalg.solve(one + K_FM @ O_u, K_FM @ O_e)
        of_redundant = -np.linalg.solve(one + K_FM @ O_u, K_FM @ O_r)
        closed = np.linalg.inv(one - of_redundant @ R_2)
        return G_1 + G_2 @ closed @ of_redundant @ R_1, G_2 @ closed, Sigma

    def two_by_two_weights(self, s: complex) -> tuple[Complex, Complex, Complex]:
        """W_z1, W_w1, W_w2 of the 2x2 problem; W_z2 = I."""
        W_z1, roll_off, modes = self.weights(s)
        K_r = self.assembly.specification.K_r
        return W_z1 / K_r, roll_off, K_r * modes

    def loops(self, s: complex, tuned: Tuned) -> tuple[Complex, Complex, Complex]:
        """S~, and G_Delta from u_1 and from u_2, of any architecture."""
        n_rb, K = self.assembly.plant.n_rb, self.K_RB(s, tuned)
        if self.assembly.architecture == "error-observer":
            G_1, G_2, Sigma = self.by_error(s, tuned)
            return np.linalg.inv(np.eye(n_rb) + G_1 @ K + G_2 @ Sigma), G_1, G_2
        if self.assembly.architecture == "output-observer":
            G_1, G_2, _, _ = self.augmented(s, tuned)
        else:
            G = self.plant(s)[:n_rb]
            G_1, G_2 = G[:, :n_rb], G[:, n_rb:]
        return np.linalg.inv(np.eye(n_rb) + G_1 @ K), G_1, G_2

    def two_by_two(self, s: complex, tuned: Tuned) -> Complex:
        """The paper's M with 2x2 blocks."""
        W_z1, W_w1, W_w2 = self.two_by_two_weights(s)
        S, G_1, G_2 = self.loops(s, tuned)
        K, left, right = self.K_RB(s, tuned), G_1 @ W_w1, G_2 @ W_w2
        return np.asarray(np.block([[W_z1 @ S @ left, W_z1 @ S @ right], [K @ S @ left, K @ S @ right]]))

    def six_blocks(self, s: complex, tuned: Tuned) -> Complex:
        """M with 6 blocks, of any architecture."""
        W_z1, W_z2, W_w3 = self.weights(s)
        S, G_1, G_2 = self.loops(s, tuned)
        columns = np.hstack([np.eye(len(S)), G_1, G_2 @ W_w3])
        return np.asarray(np.vstack([W_z1 @ S @ columns, W_z2 @ self.K_RB(s, tuned) @ S @ columns]))

    def weights(self, s: complex) -> tuple[Complex, Complex, Complex]:
        """W_z1, W_z2, W_w3 of eq. 16-18."""
        wanted, plant = self.assembly.specification, self.assembly.plant
        f_bw = wanted.bandwidths(plant.n_rb)
        w_I, w_r = 2 * np.pi * wanted.integral_ratio * f_bw, 2 * np.pi * wanted.roll_off_ratio * f_bw
        x = s / plant.omega[plant.n_rb : plant.n_rb + plant.n_flex]
        ratio = (x**2 + 2 * wanted.beta_1 * x + 1) / (x**2 + 2 * wanted.beta_2 * x + 1)
        return (
            np.diag(wanted.K_s * (s + w_I) / s),
            np.diag(wanted.K_r * (s + w_r) / (s / wanted.alpha + w_r)),
            np.diag(float(np.asarray(wanted.epsilon)) * ratio),
        )

    def M(self, s: complex, tuned: Tuned, *, blocks: int) -> Complex:
        """The paper's M with its 6 blocks, or with the 4 of the conventional design."""
        W_z1, W_z2, W_w3 = self.weights(s)
        K, n_rb = self.K_RB(s, tuned), self.assembly.plant.n_rb
        if blocks == 6:
            G_1, G_2, _, _ = self.augmented(s, tuned)
            columns = [np.eye(n_rb), G_1, G_2 @ W_w3]
        else:
            G_1 = self.plant(s)[:n_rb, :n_rb]
            columns = [np.eye(n_rb), G_1]
        S = np.linalg.inv(np.eye(n_rb) + G_1 @ K)
        return np.asarray(np.block([[W_z1 @ S @ column for column in columns], [W_z2 @ K @ S @ c for c in columns]]))


def reference(assembly: Assembly, p: Array, *, frozen: bool) -> Reference:
    """The reference at p for the plant model itself (frozen) or for its polynomial model."""
    plant = assembly.plant
    n_rb, n_flex = plant.n_rb, plant.n_flex
    fits = {name: fit.matrix.at(p) for name, fit in plant.fit.items()}
    # what the observer knows are polynomials in either case
    D_o = interpolate(plant.static_correction, box=plant.box, degree=plant.degree).matrix.at(p)
    if frozen:
        gains = plant.sample(p)
        B, C, D = gains.B[0, n_rb:], gains.C[0, :, n_rb:], gains.D[0]
    else:
        B, C, D = fits["B"].copy(), fits["C"], fits["D"]
        B[:n_flex] = np.eye(n_rb + n_flex)[n_rb:]  # extended decoupling: each its own input
    return Reference(assembly=assembly, B=B, C=C, D=D, C_o=fits["C"][:, :n_flex], D_o=D_o)


Make = Callable[..., Assembly]


@pytest.fixture(scope="session")
def assemble(small_modal: ModalModel, mmpa: MMPA) -> Make:
    """Assemblies of the small plant or the benchmark, kept for all tests."""
    plants: dict[tuple[str, int, str], DecoupledPlant] = {}
    made: dict[tuple[str, int, float, str, str, str | None], Assembly] = {}

    def make(
        name: str,
        n_flex: int = 1,
        *,
        delay: float = 0.0,
        sensing: str = "all",
        architecture: str = "output-observer",
        problem: str | None = None,
    ) -> Assembly:
        which, key = (name, n_flex, sensing), (name, n_flex, delay, sensing, architecture, problem)
        if which not in plants:
            source, degree = (small_modal, 12) if name == "small" else (mmpa, 8)
            plants[which] = decouple(source, n_flex=n_flex, sensing=sensing, degree=degree)
        if key not in made:
            settings: dict[str, Any] = vars(SMALL if name == "small" else BENCHMARK)
            wanted = Specification(**{**settings, "delay": delay})
            made[key] = Assembly(
                plant=plants[which], specification=wanted, architecture=architecture, problem_name=problem
            )
        return made[key]

    return make


@pytest.fixture(scope="session")
def tune() -> Callable[..., Tuned]:
    return random_tuned


@pytest.fixture(scope="session")
def refer() -> Callable[..., Reference]:
    return reference


@pytest.fixture(scope="session")
def resonances() -> Callable[[Assembly], Array]:
    """Frequencies from far below to far above, and on both flanks of the first resonances [rad/s]."""

    def frequencies(assembly: Assembly) -> Array:
        n_rb = assembly.plant.n_rb
        w, z = assembly.plant.omega[n_rb : n_rb + 4], assembly.plant.zeta[n_rb : n_rb + 4]
        others = 2 * np.pi * np.array([0.05, 3.0, 20.0, 40.0, 90.0, 700.0, 6000.0])
        return np.sort(np.concatenate([others, w, w * (1 - z), w * (1 + z)]))

    return frequencies


@pytest.fixture(scope="session")
def response() -> Callable[[tuple[Array, Array, Array, Array], float], Array]:
    """C (j omega I - A)^-1 B + D."""

    def at(system: tuple[Array, Array, Array, Array], omega: float) -> Array:
        A, B, C, D = system
        return np.asarray(C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D)

    return at
