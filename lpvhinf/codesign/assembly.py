"""From a decoupled plant and a specification to loops: over the whole box, or frozen at positions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.codesign.parameters import ParameterLayout
from lpvhinf.codesign.specification import Specification
from lpvhinf.controllers import (
    FreeRigidBodyStructure,
    RigidBodyStructure,
    error_observer_model,
    initial_gain,
    observer_model,
    process_noise,
    riccati_gain,
)
from lpvhinf.decoupling import DecoupledPlant
from lpvhinf.fitting import interpolate
from lpvhinf.hinfstruct import ControllerStructure, DiagonalGain, StaticGain
from lpvhinf.polynomial import ChebyshevMatrix
from lpvhinf.problems import (
    SIX_BLOCK,
    TWO_BY_TWO,
    Gain,
    Loop,
    ObserverBranch,
    Realized,
    TunedParts,
    checked_problem,
    four_block,
    six_block,
    two_by_two,
)
from lpvhinf.shaping import Scaling, ShapingFilters, pade_delay, scaling
from lpvhinf.statespace.generalized import GeneralizedPlant
from lpvhinf.statespace.lpv import LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant

RIGID_BODY, OUTPUT_OBSERVER, ERROR_OBSERVER = ARCHITECTURES = ("rigid-body", "output-observer", "error-observer")
# A scheduled K_RB is handed out as polynomials of this degree: exponentials of low-order ones, good to about 1e-10.
K_RB_DEGREE = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembly:
    """Everything of a co-design that does not depend on the tuned parameters.

    The observer's matrices are what a controller would implement: polynomials, from the known model of the
    plant. The plant beside it is the polynomial one in `loop`, and the plant model itself in `frozen_loops`.

    `problem_name` is "six-block" (which is the 4-block problem without observer) or "two-by-two"; None takes the
    paper's one for the architecture, the latter for the error-based observer.
    """

    plant: DecoupledPlant
    specification: Specification
    architecture: str
    problem_name: str | None = None

    def __post_init__(self) -> None:
        default = TWO_BY_TWO if self.architecture == ERROR_OBSERVER else SIX_BLOCK
        name = default if self.problem_name is None else checked_problem(self.problem_name)
        object.__setattr__(self, "problem_name", name)

    @cached_property
    def scaling(self) -> Scaling:
        """Scalings of the channels and of the observer's states, from what is known of the plant."""
        return self._scaling_of(self.plant.known)

    @cached_property
    def plant_scaling(self) -> Scaling:
        """The same scalings of the channels, with those of the true plant's own states."""
        if self.plant.known is self.plant:
            return self.scaling
        return dataclasses.replace(self.scaling, state=self._scaling_of(self.plant).state)

    def _scaling_of(self, plant: DecoupledPlant) -> Scaling:
        n_rb = plant.n_rb
        return scaling(plant, self.specification.bandwidths(n_rb), self.specification.errors(n_rb))

    @cached_property
    def omega_flex(self) -> Array:
        """Frequencies of the controlled modes (n_flex,) [rad/s], as they are known."""
        n_rb = self.plant.n_rb
        return np.asarray(self.plant.known.omega[n_rb : n_rb + self.plant.n_flex])

    @cached_property
    def filters(self) -> ShapingFilters:
        """The shaping filters."""
        return self.specification.filters(self.omega_flex, self.plant.n_rb)

    @cached_property
    def observer(self) -> ObserverBranch | None:
        """The observer's scheduled model, or None for the conventional design."""
        if self.architecture == RIGID_BODY:
            return None
        known = self.plant.known
        by_error = self.architecture == ERROR_OBSERVER
        correction = interpolate(known.static_correction, box=known.box, degree=known.degree).matrix
        size = float(np.max(np.abs(correction.coefficients)))
        compliance = self.scaling.correction(correction.trimmed(1e-13 * size))
        scaled = self.scaling.apply(known.system)
        if by_error:
            model = error_observer_model(scaled, known.n_rb, known.n_flex, compliance)
        else:
            model = observer_model(scaled, known.n_rb + known.n_flex, compliance)
        rigid = np.repeat(2 * np.pi * self.scaling.f_bw, 2)
        # a mode's correction is scaled by the bandwidth too: its Riccati gain is far below omega_i
        flexible = np.full(2 * known.n_flex, float(np.max(rigid)))
        return ObserverBranch(
            model=model,
            omega=self.omega_flex,
            Q=self.specification.Q,
            injection=flexible if by_error else np.concatenate([rigid, flexible]),
            fed_by_error=by_error,
        )

    @property
    def observed(self) -> slice:
        """The states of the known plant that the observer estimates."""
        n_rb, n_flex = self.plant.n_rb, self.plant.n_flex
        return slice(2 * n_rb if self.architecture == ERROR_OBSERVER else 0, 2 * (n_rb + n_flex))

    @cached_property
    def loop(self) -> Loop:
        """The loop with the polynomial plant, over the whole box."""
        return self._loop(self.plant.system, self.observer)

    def frozen_loops(self, points: Array) -> list[Loop]:
        """The loops with the plant model itself at positions (N, n_p)."""
        systems = self.plant.frozen(points)
        if self.observer is None:
            return [self._loop(system, None) for system in systems]
        box, model = self.plant.box, self.observer.model
        B, C, D = model.B.sample(points), model.C.sample(points), model.D.sample(points)
        loops = []
        for system, b, c, d in zip(systems, B, C, D, strict=True):
            frozen = LPVStateSpace(model.A, *(ChebyshevMatrix(m, box) for m in (b, c, d)))
            loops.append(self._loop(system, dataclasses.replace(self.observer, model=frozen)))
        return loops

    def _loop(self, system: LPVStateSpace, observer: ObserverBranch | None) -> Loop:
        plant = self.plant_scaling.apply(system)
        if self.specification.delay > 0.0:
            delay = pade_delay(self.specification.delay, self.specification.delay_order, self.plant.n_out)
            plant = plant.series(LPVStateSpace.from_system(delay, plant.box))
        return Loop(plant=plant, filters=self.filters, n_rb=self.plant.n_rb, observer=observer)

    def problem(self, loop: Loop) -> LPVGeneralizedPlant:
        """The synthesis problem around a loop."""
        if self.problem_name == TWO_BY_TWO:
            return two_by_two(loop)
        return four_block(loop) if self.architecture == RIGID_BODY else six_block(loop)

    def generalized_plants(self, points: Array) -> list[GeneralizedPlant]:
        """The synthesis problem with the plant model itself, frozen at positions (N, n_p)."""
        centre = np.mean(self.plant.box, axis=1)
        return [self.problem(loop).at(centre) for loop in self.frozen_loops(points)]

    @cached_property
    def rigid_body(self) -> RigidBodyStructure | FreeRigidBodyStructure:
        """The structure of K_RB: the paper's PID, with the notches that are asked for, or one of free order."""
        w = 2 * np.pi * self.scaling.f_bw
        spec = self.specification
        if spec.order_K_RB is not None:
            f_states = self._frequencies((spec.order_K_RB - 1) // 2)
            return FreeRigidBodyStructure(self.filters.f_I, w**2, spec.order_K_RB, f_states)
        return RigidBodyStructure(self.filters.f_I, w**2, spec.n_notches, self._frequencies(spec.n_notches))

    def _frequencies(self, n: int) -> Array:
        """Where n notches start [Hz]: known flexible modes, those that u_RB drives first; then octaves above."""
        known = self.plant.known
        omega = known.omega[known.n_rb :]
        if known.input_decoupling == "extended":
            omega = np.concatenate([omega[known.n_flex :], omega[: known.n_flex]])
        f = omega[:n] / (2 * np.pi)
        highest = float(np.max(np.concatenate([f, self.scaling.f_bw])))
        return np.concatenate([f, highest * 2.0 ** np.arange(1, n - len(f) + 1)])

    @cached_property
    def layout(self) -> ParameterLayout:
        """The tuned parts "K_RB", "L" and "xi" in theta, and which of them depend on p."""
        parts: dict[str, ControllerStructure] = {"K_RB": self.rigid_body}
        if self.observer is not None:
            parts["L"] = StaticGain(self.observer.model.n_x, self.plant.n_out)
            parts["xi"] = DiagonalGain(self.plant.n_flex)
        return ParameterLayout(parts, self.specification.schedule, self.plant.box)

    @property
    def structure(self) -> ControllerStructure:
        """The tuned part diag(K_RB, L, -xi) as a structure for `hinfstruct`."""
        return self.layout.structure

    def split(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array]:
        """Parameters of K_RB, L (n_o, n_out) and xi (n_flex,) in theta; at p, by default the centre, if scheduled."""
        parts = self.layout.frozen(theta, np.mean(self.plant.box, axis=1) if p is None else p)
        if self.observer is None:
            return parts["K_RB"], np.zeros((0, self.plant.n_out)), np.zeros(0)
        # the structure tunes u_FM = k v, k = -xi of either sign
        return parts["K_RB"], parts["L"].reshape(self.observer.model.n_x, -1), -parts["xi"]

    def translated(self, other: Assembly, theta: Array) -> Array:
        """The parameters here of a design of another assembly with the same architecture, K_RB in the units of this."""
        rows = other.layout.coefficients(theta)["K_RB"]
        own = self.rigid_body.parameters(other.rigid_body.gains(rows[0]))
        if len(rows) == 1:
            constant = ParameterLayout(
                {**other.layout.inner, "K_RB": self.rigid_body}, other.layout.degrees, self.plant.box
            )
            moved = np.concatenate([own, np.asarray(theta)[other.rigid_body.n_parameters :]])
            return self.layout.converted(constant, moved)
        # the parameters of a PID are logarithms: units change the constant coefficients only
        moved = np.array(theta, dtype=float)
        moved[: len(own)] = own
        return self.layout.converted(other.layout, moved)

    def tuned_parts(self, theta: Array, p: Array | None = None) -> TunedParts:
        """The tuned part at theta: at a position, or over the box, then polynomials where it is scheduled."""
        layout = self.layout
        rigid, constant_L, constant_xi = self.split(theta, p)
        K_RB: Realized = self.rigid_body.realize(rigid)
        if p is None and "K_RB" in layout.basis:
            K_RB = self._interpolated(theta)
        if self.observer is None:
            return TunedParts(K_RB=K_RB)
        L: Gain = constant_L
        xi: Gain = constant_xi
        if p is None and "L" in layout.basis:
            entries = layout.polynomial("L", theta).coefficients
            L = ChebyshevMatrix(entries.reshape(*entries.shape[:-2], *constant_L.shape), layout.box)
        if p is None and "xi" in layout.basis:
            xi = -layout.polynomial("xi", theta)
        return TunedParts(K_RB=K_RB, L=L, xi=xi)

    def _interpolated(self, theta: Array) -> Realized:
        """A scheduled K_RB as polynomial matrices: its parameters are exponentials of polynomials."""
        n_x, n_u, n_y = self.rigid_body.n_x, self.rigid_body.n_u, self.rigid_body.n_y

        def matrices(points: Array) -> Array:
            gains = (self.rigid_body.realize(self.split(theta, p)[0]) for p in points)
            return np.array([np.block([[A, B], [C, D]]) for A, B, C, D in gains])

        whole = interpolate(matrices, box=self.plant.box, degree=K_RB_DEGREE).matrix
        x, u, y = slice(0, n_x), slice(n_x, n_x + n_u), slice(n_x, n_x + n_y)
        A, B, C = (part.trimmed() for part in (whole[x, x], whole[x, y], whole[u, x]))
        return A, B, C, np.zeros((n_u, n_y))

    @cached_property
    def measurement_noise(self) -> Array:
        """Diagonal of R of the Riccati equation: equal scaled noise on all outputs, at the bandwidth of the loop."""
        omega_bw = 2 * np.pi * self.scaling.f_bw
        return 1.0 / np.concatenate([omega_bw, np.full(self.plant.n_out - self.plant.n_rb, np.max(omega_bw))])

    def start(
        self, points: Array, rigid: Array | None = None, xi: float = 0.1, noise_ratio: float | None = None
    ) -> Array:
        """A first theta: K_RB by rule of thumb or as given, L from the Riccati equation, damping gain xi.

        With `noise_ratio` the Riccati equation is solved at the centre of P for this ratio of process noise;
        without it, for the largest one whose observer is stable at all `points`.
        """
        if rigid is None:
            rigid = self.rigid_body.parameters(self.rigid_body.rule_of_thumb(self.scaling.f_bw))
        if self.observer is None:
            return self.layout.expanded(np.asarray(rigid))
        # an observer of flexible modes alone has no rigid-body velocities that noise could act on
        omega_bw = 2 * np.pi * self.scaling.f_bw[: 0 if self.observer.fed_by_error else None]
        if noise_ratio is None:
            L, _ = initial_gain(
                self.observer.model,
                points,
                omega_bw=omega_bw,
                omega_flex=self.omega_flex,
                measurement_noise=self.measurement_noise,
            )
        else:
            noise = process_noise(omega_bw, self.omega_flex, noise_ratio)
            L = riccati_gain(self.observer.model, np.mean(self.plant.box, axis=1), noise, self.measurement_noise)
        gain = L / self.observer.injection[:, None]
        return self.layout.expanded(np.concatenate([rigid, gain.ravel(), np.full(self.plant.n_flex, -xi)]))
