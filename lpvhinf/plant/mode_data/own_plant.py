"""From modal data, actuators and sensors to the modal model that decoupling and design take."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, box_array, whole_number
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.plant.mechanical import names
from lpvhinf.plant.modal import ModalModel
from lpvhinf.plant.mode_data.actuators_sensors import DIRECTIONS, Actuator, Sensor, Station, StationArray
from lpvhinf.plant.mode_data.agreement import OUT_OF_PLANE
from lpvhinf.plant.mode_data.mode_data import ModeData
from lpvhinf.plant.mode_data.mode_shapes import EDGE, ModeShapes
from lpvhinf.plant.mode_data.rigid_body import RigidBody, axis_indices
from lpvhinf.plant.mode_data.shape_fit import ShapeFit
from lpvhinf.plant.rigid_motion import AXES


@dataclass(frozen=True, kw_only=True, eq=False)
class StationGains:
    """Mass-normalised gains of stations, (N, n_p) -> (N, n, n_modes): rigid-body modes, then flexible ones."""

    stations: StationArray
    shapes: ModeShapes
    body: RigidBody
    axes: tuple[str, ...]

    def __call__(self, points: Array) -> Array:
        """Gains at positions `points` (N, n_p)."""
        at = self.stations.at(points)
        flexible = self.shapes.at(at)
        rigid = self.body.motions(at, self.axes) @ self.body.scaling(self.axes) if self.axes else flexible[..., :0]
        fields = np.concatenate([rigid, flexible], axis=-1)
        return np.asarray(np.einsum("nkcm,kc->nkm", fields, self.stations.vectors))


@dataclass(frozen=True, kw_only=True, eq=False)
class InputGains:
    """The transpose of station gains, (N, n_modes, n_u): modal forces per unit of every actuator."""

    gains: StationGains

    def __call__(self, points: Array) -> Array:
        """Gains at positions `points` (N, n_p)."""
        return np.swapaxes(self.gains(points), 1, 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class StaticCompliance:
    r"""Modes that are kept as their compliance only, :math:`\sum_k \phi_k(\cdot)\phi_k(\cdot)^\top / \omega_k^2`."""

    outputs: StationGains
    inputs: StationGains
    omega: Array

    def __call__(self, points: Array) -> Array:
        """Compliance (N, n_y, n_u) at positions `points` (N, n_p)."""
        return np.asarray((self.outputs(points) / self.omega**2) @ np.swapaxes(self.inputs(points), 1, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnPlant:
    """A user's plant, as `decouple` takes it.

    Attributes
    ----------
    modal : ModalModel
        Rigid-body modes along `axes` about the centre of gravity, then the flexible modes.
    data : ModeData
    fit : ShapeFit
        The mode shapes as polynomials, and how well they fit.
    axes : tuple of str
        Names of the rigid-body axes.
    actuators, sensors : tuple
    """

    modal: ModalModel
    data: ModeData
    fit: ShapeFit
    axes: tuple[str, ...]
    actuators: tuple[Actuator, ...]
    sensors: tuple[Sensor, ...]

    @property
    def box(self) -> Array:
        """The box P of positions, (n_p, 2) [m]."""
        return self.modal.box

    @property
    def rigid_body_names(self) -> tuple[str, ...]:
        """Order of the rigid-body modes."""
        return self.axes

    def report(self) -> str:
        """The plant in a few lines of text."""
        body, modal, n_rb = self.data.body, self.modal, self.modal.n_rb
        nodes = f"{self.fit.n_nodes} nodes, degree {self.fit.shapes.degree[:2]}" if self.fit.n_nodes else "polynomials"
        lines = [
            f"{body.mass:.4g} kg, rigid axes {', '.join(self.axes)}; {modal.n_u} actuators, {modal.n_y} sensors",
            f"mode shapes from {nodes}",
            "  mode      Hz  damping  fit error, nodes left out",
        ]
        for k, (error, omega, zeta) in enumerate(
            zip(self.fit.left_out, self.data.omega_flex, self.data.zeta_flex, strict=True)
        ):
            kept = "" if k < modal.n_modes - n_rb else "  (compliance only)"
            lines.append(f"  {k + 1:4d} {omega / (2 * np.pi):7.1f} {zeta:8.4f}  {error:.1e}{kept}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"OwnPlant(axes={self.axes}, {self.modal!r})"


def own_plant(
    data: ModeData,
    *,
    actuators: Sequence[Actuator],
    sensors: Sequence[Sensor],
    box: ArrayLike,
    axes: Sequence[str] | None = None,
    n_flex: int | None = None,
    position_axes: Sequence[str] | None = None,
    degree: int | Sequence[int] | None = None,
    tolerance: float = 0.02,
) -> OwnPlant:
    r"""A user's own plant from modal data, for `decouple` and `codesign`.

    .. math::

        \ddot\eta_k + 2\zeta_k\omega_k\dot\eta_k + \omega_k^2\eta_k = \sum_a g_a\, d_a^\top\phi_k(r_a(p))\, u_a, \qquad
        y_s = \sum_k g_s\, d_s^\top\phi_k(r_s(p))\, \eta_k

    Parameters
    ----------
    data : ModeData
        Modes and rigid-body data.
    actuators, sensors : sequences of Actuator and Sensor
        In mover coordinates at p = 0.
    box : (n_p, 2)
        The box P: smallest and largest displacement of the mover along `position_axes` [m].
    axes : sequence of str, optional
        Rigid-body axes of the model; default z, rx, ry if the shapes are w alone, else x, y, z, rx, ry, rz. An axis
        that is left out is held by something else and does not move.
    n_flex : int, optional
        Number of flexible modes with dynamics, the lowest ones; the others keep their static compliance. All if left
        out.
    position_axes : sequence of "x", "y", "z", optional
        What the coordinates of p are; x, then y, then z if left out.
    degree, tolerance
        Of the fit of mode shapes given at nodes, as in `fit_shapes`.

    Raises
    ------
    DomainError
        If an actuator or sensor meets a point outside the mover at some p in the box, nodes are too few, or an option
        is unknown.
    DimensionError
        If `box` and `position_axes` disagree, or there are no actuators or sensors.
    AssumptionError
        If the fit is worse than `tolerance`, or an actuator or sensor points along an axis that is not in `axes`.

    Notes
    -----
    The points met are affine in p and the mover's outline is convex, so the corners of the box decide whether all lie
    inside.

    Examples
    --------
    A plate of 0.3 m on four actuators, seen by four beams on the frame; torsion is its first mode.

    >>> x, y = np.meshgrid(np.linspace(-0.15, 0.15, 5), np.linspace(-0.15, 0.15, 5))
    >>> data = ModeData(
    ...     frequency_hz=[140.0], damping=0.01,
    ...     body=RigidBody(mass=6.0, centre_of_gravity=[0.0, 0.0], inertia=[0.045, 0.045, 0.09]),
    ...     points=np.column_stack([x.ravel(), y.ravel()]), shapes=54.0 * (x * y).reshape(-1, 1))
    >>> corners = [(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    >>> plant = own_plant(
    ...     data, box=[[-0.05, 0.05], [-0.05, 0.05]],
    ...     actuators=[Actuator(place=[0.12 * a, 0.12 * b], fixed_to="mover") for a, b in corners],
    ...     sensors=[Sensor(place=[0.1 * a, 0.1 * b], fixed_to="frame") for a, b in corners])
    >>> plant
    OwnPlant(axes=('z', 'rx', 'ry'), ModalModel(n_rb=3, n_flex=1, n_u=4, n_y=4, box=[[-0.05, 0.05], [-0.05, 0.05]]))
    >>> plant.modal.output_gains([0.05, 0.0])[0, :, 3].round(3).tolist()
    [0.81, -0.81, -0.27, 0.27]
    """
    bounds = box_array(box)
    if not isinstance(data, ModeData):
        raise DomainError(f"data is a {type(data).__name__}, wanted a ModeData.")
    kinds: tuple[tuple[str, Sequence[Station], type[Station]], ...] = (
        ("actuators", actuators, Actuator),
        ("sensors", sensors, Sensor),
    )
    for argument, stations, kind in kinds:
        if len(stations) == 0:
            raise DimensionError(f"{argument} is empty, wanted at least one {kind.__name__}.")
        wrong = [type(station).__name__ for station in stations if not isinstance(station, kind)]
        if wrong:
            raise DomainError(f"{argument} has a {wrong[0]}, wanted objects of the type {kind.__name__}.")
    along = tuple("xyz"[: len(bounds)] if position_axes is None else position_axes)
    if len(along) != len(bounds) or len(set(along)) != len(along) or not set(along) <= set(DIRECTIONS):
        raise DimensionError(
            f"position_axes is {along} and box has {len(bounds)} rows, wanted one of x, y, z for each row of the box."
        )
    chosen = tuple(OUT_OF_PLANE if data.out_of_plane else AXES) if axes is None else tuple(axes)
    chosen = tuple(AXES[k] for k in axis_indices(chosen))
    kept = data.n_flex if n_flex is None else whole_number("n_flex", n_flex, 0)
    if kept > data.n_flex:
        raise DomainError(f"n_flex is {kept}, wanted at most {data.n_flex}, the number of flexible modes in data.")
    fit = data.smooth(degree=degree, tolerance=tolerance)
    arrays = {}
    for argument, stations, _ in kinds:
        arrays[argument] = StationArray.of(stations, along, fit.shapes.height)
        _check_axes(argument, stations, chosen)
        _check_places(argument, stations, arrays[argument], fit.shapes, bounds)

    def gains(argument: str, modes: slice, rigid: tuple[str, ...]) -> StationGains:
        return StationGains(stations=arrays[argument], shapes=fit.shapes.modes(modes), body=data.body, axes=rigid)

    low, tail = slice(0, kept), slice(kept, None)
    n_rb, omega = len(chosen), data.omega_flex
    modal = ModalModel.from_modal_data(
        omega=np.concatenate([np.zeros(n_rb), omega[low]]),
        zeta=np.concatenate([np.zeros(n_rb), data.zeta_flex[low]]),
        n_rb=n_rb,
        input_gains=InputGains(gains=gains("actuators", low, chosen)),
        output_gains=gains("sensors", low, chosen),
        box=bounds,
        compliance=None
        if kept == data.n_flex
        else StaticCompliance(
            outputs=gains("sensors", tail, ()), inputs=gains("actuators", tail, ()), omega=omega[tail]
        ),
        mass_matrix_rb=data.body.mass_matrix(chosen),
        rigid_body_scaling=data.body.scaling(chosen),
        input_names=_labels("actuators", actuators, "u"),
        output_names=_labels("sensors", sensors, "y"),
    )
    return OwnPlant(modal=modal, data=data, fit=fit, axes=chosen, actuators=tuple(actuators), sensors=tuple(sensors))


def _labels(argument: str, stations: Sequence[Station], letter: str) -> tuple[str, ...]:
    """Names as given, letter and number where there is none."""
    given = [station.name or f"{letter}{k + 1}" for k, station in enumerate(stations)]
    return names(f"names of the {argument}", given, len(stations), letter)


def _check_axes(argument: str, stations: Sequence[Station], axes: tuple[str, ...]) -> None:
    for k, station in enumerate(stations):
        for component, axis in zip(np.asarray(station.direction), "xyz", strict=True):
            if abs(component) > 1e-9 and axis not in axes:
                raise AssumptionError(
                    f"{argument}[{k}] has the direction {np.asarray(station.direction).tolist()}, but {axis} is not "
                    f"among the axes {axes}: its part along {axis} would be lost. Add {axis!r} to axes, or leave the "
                    f"{type(station).__name__.lower()} out."
                )


def _check_places(
    argument: str, stations: Sequence[Station], array: StationArray, shapes: ModeShapes, box: Array
) -> None:
    """A `DomainError` if a station meets a point outside the mover at a corner of the box."""
    corners = np.array(list(itertools.product(*box)))
    met = array.at(corners)
    excess = shapes.excess(met)
    if np.max(excess) > EDGE:
        n, k = (int(i) for i in np.unravel_index(int(np.argmax(excess)), excess.shape))
        moves = stations[k].fixed_to == "frame"
        raise DomainError(
            f"{argument}[{k}] at {stations[k].place.tolist()} m, fixed to the {stations[k].fixed_to}, "
            + (f"meets the mover point {met[n, k].tolist()} m at p = {corners[n].tolist()}, " if moves else "lies ")
            + f"outside the mover: {shapes.describe()}. Mode shapes are not extrapolated: move it"
            + (", make the box smaller," if moves else "")
            + " or export nodes up to the mover's edge."
        )
