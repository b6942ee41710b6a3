"""The modal data of a user's own mover, checked for sense on the way in."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lpvhinf.checks import Array, finite_array, read_only
from lpvhinf.errors import DomainError
from lpvhinf.plant.mode_data.agreement import check_node_masses, check_rigid_modes
from lpvhinf.plant.mode_data.csv_files import read_csv, write_csv
from lpvhinf.plant.mode_data.given_shapes import nodal_shapes, non_negative, power_series
from lpvhinf.plant.mode_data.mat_file import read_mat, write_mat
from lpvhinf.plant.mode_data.mode_shapes import power_shapes, spatial
from lpvhinf.plant.mode_data.plausibility import (
    Plausibility,
    check_amplitudes,
    check_damping,
    check_frequencies,
    check_normalisation,
    check_sizes,
    mode_labels,
)
from lpvhinf.plant.mode_data.rigid_body import RigidBody
from lpvhinf.plant.mode_data.shape_fit import ShapeFit, fit_shapes

GRID = 15  # points along each side at which the amplitudes of polynomial shapes are looked at


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeData:
    r"""Modes of a free mover from a finite-element model or a measurement, in SI units.

    .. math:: d(r, t) = \sum_k \phi_k(r)\, \eta_k(t), \qquad \int \phi_i^\top \phi_j\, dm = \delta_{ij}

    Mode shapes are given at nodes (`points` and `shapes`) or as power series (`polynomials` over `area`).

    Parameters
    ----------
    frequency_hz : (n_modes,)
        Undamped eigenfrequencies [Hz], increasing. Modes below ``limits.rigid_below_hz`` are rigid-body modes: they
        are compared with `body` and then replaced by what follows from it.
    damping : (n_modes,) or float
        Damping ratios [-], not percent; those of rigid-body modes do not count.
    body : RigidBody
        Mass, centre of gravity and inertia.
    points : (n_nodes, 2) or (n_nodes, 3)
        Nodes in mover coordinates [m]. With w alone, z is the height of the neutral plane.
    shapes : (n_nodes, n_modes) or (n_nodes, 3, n_modes)
        Mass-normalised displacements [1/sqrt(kg)] at the nodes: w (out of plane), or u, v, w. One column a mode.
    polynomials : (nx + 1, ny + 1, n_modes) or (nx + 1, ny + 1, 3, n_modes)
        Coefficients of x^i y^j, x and y in m, in the plane z = 0; instead of `points` and `shapes`.
    area : (2, 2)
        Smallest and largest x and y [m] of the mover; with `polynomials`.
    modal_mass : (n_modes,), optional
        Modal masses [kg] if the shapes are normalised in another way; they are divided by its root.
    node_mass : (n_nodes,), optional
        Masses lumped at the nodes [kg]; used for checks only.
    limits : Plausibility, optional
        What is taken for plausible.

    Raises
    ------
    DimensionError
        If a shape is wrong or sizes disagree.
    DomainError
        If a number is not finite, or has an impossible sign, order, size or unit.
    AssumptionError
        If mass and inertia disagree with the mode shapes.

    Notes
    -----
    Arrays are copied and read-only; they stay as given, and what is derived from them is mass-normalised.

    Examples
    --------
    A square plate of 0.3 m and 6 kg with its torsion mode at 25 nodes:

    >>> x, y = np.meshgrid(np.linspace(-0.15, 0.15, 5), np.linspace(-0.15, 0.15, 5))
    >>> data = ModeData(
    ...     frequency_hz=[140.0], damping=0.01,
    ...     body=RigidBody(mass=6.0, centre_of_gravity=[0.0, 0.0], inertia=[0.045, 0.045, 0.09]),
    ...     points=np.column_stack([x.ravel(), y.ravel()]), shapes=54.0 * (x * y).reshape(-1, 1))
    >>> data
    ModeData(25 nodes, 1 flexible mode from 140 Hz, 0 at zero frequency, 6 kg)
    """

    frequency_hz: Array
    damping: Array
    body: RigidBody
    points: Array | None = None
    shapes: Array | None = None
    polynomials: Array | None = None
    area: Array | None = None
    modal_mass: Array | None = None
    node_mass: Array | None = None
    limits: Plausibility = field(default_factory=Plausibility)

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, read_only(value))

        limits = self.limits
        frequency = finite_array("frequency_hz", self.frequency_hz, (None,))
        check_frequencies(frequency, limits.rigid_below_hz)
        if not np.any(frequency >= limits.rigid_below_hz):
            raise DomainError(
                f"frequency_hz is {frequency.tolist()}, wanted at least one flexible mode above "
                f"limits.rigid_below_hz = {limits.rigid_below_hz:g} Hz."
            )
        put("frequency_hz", frequency)
        n_modes = len(frequency)
        damping = finite_array("damping", self.damping)
        put("damping", finite_array("damping", np.full(n_modes, damping) if damping.ndim == 0 else damping, (n_modes,)))
        check_damping(self.damping, self.labels, limits.damping)
        if not isinstance(self.body, RigidBody):
            raise DomainError(f"body is a {type(self.body).__name__}, wanted a RigidBody(mass=..., ...).")
        if self.modal_mass is not None:
            put("modal_mass", non_negative("modal_mass", self.modal_mass, n_modes, "kg", zero=False))
        given = [name for name in ("points", "shapes", "polynomials", "area") if getattr(self, name) is not None]
        if given == ["points", "shapes"]:
            points, shapes = nodal_shapes(getattr(self, given[0]), getattr(self, given[1]), n_modes)
            put("points", points)
            put("shapes", shapes)
        elif given == ["polynomials", "area"] and self.node_mass is None:
            area, polynomials = power_series(getattr(self, given[0]), getattr(self, given[1]), n_modes)
            put("area", area)
            put("polynomials", polynomials)
        else:
            more = " and node_mass" if self.node_mass is not None else ""
            raise DomainError(
                f"the mode shapes are given by {', '.join(given) or 'nothing'}{more}, wanted points and shapes (and "
                "perhaps node_mass), or polynomials and area."
            )
        if self.node_mass is not None:
            put("node_mass", non_negative("node_mass", self.node_mass, len(points), "kg", zero=True))
        self._check_physics()

    def _check_physics(self) -> None:
        """Units and masses: what is most specific comes first."""
        places, values = self._samples()
        zero, labels, body, limits = self.n_zero, self.labels, self.body, self.limits
        check_sizes(places, body, limits)
        flexible = values[..., zero:]
        if self.modal_mass is None:
            check_normalisation(flexible)
        check_rigid_modes(places, values[..., :zero], labels[:zero], body, limits)
        if self.node_mass is not None:
            check_node_masses(places, flexible, self.node_mass, labels[zero:], body, limits)
        check_amplitudes(flexible, labels[zero:], body, limits)

    @classmethod
    def from_csv(cls, folder: str | os.PathLike[str], *, limits: Plausibility | None = None) -> ModeData:
        """Read ``modes.csv``, ``body.csv`` and ``shapes.csv`` or ``polynomials.csv`` of a folder.

        Columns and units are in ``docs/own_plant.md`` and in `lpvhinf.plant.mode_data.csv_files`.

        Raises
        ------
        StorageError
            If a file or column is missing, or an entry is no number.
        DimensionError, DomainError, AssumptionError
            As the constructor.
        """
        return cls._from_arrays(read_csv(folder), limits)

    @classmethod
    def from_mat(cls, path: str | os.PathLike[str], *, limits: Plausibility | None = None) -> ModeData:
        """Read a MAT file (version 4 to 7) with one variable for each array.

        Variables and units are in ``docs/own_plant.md`` and in `lpvhinf.plant.mode_data.mat_file`.

        Raises
        ------
        StorageError
            If the file or a variable is missing, or the file is of version 7.3.
        DimensionError, DomainError, AssumptionError
            As the constructor.
        """
        return cls._from_arrays(read_mat(path), limits)

    @classmethod
    def _from_arrays(cls, arrays: dict[str, Array], limits: Plausibility | None) -> ModeData:
        given: dict[str, Any] = dict(arrays)
        body = RigidBody(
            mass=float(finite_array("mass", given.pop("mass"), ())),
            centre_of_gravity=given.pop("centre_of_gravity"),
            inertia=given.pop("inertia"),
        )
        return cls(body=body, limits=Plausibility() if limits is None else limits, **given)

    def save_csv(self, folder: str | os.PathLike[str]) -> None:
        """Write the files that `from_csv` reads, every digit kept."""
        write_csv(folder, self._arrays())

    def save_mat(self, path: str | os.PathLike[str]) -> None:
        """Write the MAT file that `from_mat` reads."""
        write_mat(path, self._arrays())

    def _arrays(self) -> dict[str, Array]:
        names = ("frequency_hz", "damping", "modal_mass", "points", "shapes", "node_mass", "polynomials", "area")
        arrays = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        body = self.body
        return arrays | {
            "mass": np.array(body.mass),
            "centre_of_gravity": body.centre_of_gravity,
            "inertia": body.inertia,
        }

    @property
    def n_zero(self) -> int:
        """Number of modes that are rigid-body modes of the export."""
        return int(np.sum(self.frequency_hz < self.limits.rigid_below_hz))

    @property
    def n_flex(self) -> int:
        """Number of flexible modes."""
        return len(self.frequency_hz) - self.n_zero

    @property
    def omega_flex(self) -> Array:
        """Frequencies of the flexible modes (n_flex,) [rad/s]."""
        return np.asarray(2.0 * np.pi * self.frequency_hz[self.n_zero :])

    @property
    def zeta_flex(self) -> Array:
        """Damping ratios of the flexible modes (n_flex,)."""
        return np.asarray(self.damping[self.n_zero :])

    @property
    def labels(self) -> list[str]:
        """The modes in words, for messages and reports."""
        return mode_labels(self.frequency_hz)

    @property
    def out_of_plane(self) -> bool:
        """Whether the shapes are w alone."""
        return (self.shapes is not None and self.shapes.ndim == 2) or (
            self.polynomials is not None and self.polynomials.ndim == 3
        )

    def smooth(self, *, degree: int | Sequence[int] | None = None, tolerance: float = 0.02) -> ShapeFit:
        """The flexible modes, mass-normalised, as polynomials in the place.

        Parameters
        ----------
        degree, tolerance
            As in `fit_shapes`; of no use for shapes that are polynomials already.

        Raises
        ------
        DomainError
            If the nodes are too few.
        AssumptionError
            If the fit's leave-one-out error is above `tolerance`.
        """
        if self.polynomials is None:
            places, values = self._samples()
            return fit_shapes(places, self._stacked(values[..., self.n_zero :]), degree=degree, tolerance=tolerance)
        if degree is not None:
            raise DomainError(f"degree is {degree!r}, but the shapes are polynomials already. Leave it out.")
        assert self.area is not None
        shapes = power_shapes(self._normalised(self.polynomials)[..., self.n_zero :], self.area)
        exact = np.zeros(self.n_flex)
        return ShapeFit(shapes=shapes, n_nodes=0, smoothing=0.0, residual=exact, left_out=exact)

    def _normalised(self, given: Array) -> Array:
        """Shapes or polynomials mass-normalised, with an axis of 1 or 3 components before that of the modes."""
        scaled = given if self.modal_mass is None else given / np.sqrt(self.modal_mass)
        return scaled[..., None, :] if self.out_of_plane else scaled

    def _samples(self) -> tuple[Array, Array]:
        """Places (n, 3) and mass-normalised shapes (n, 1 or 3, n_modes) of all modes there."""
        if self.points is not None and self.shapes is not None:
            return spatial(self.points, 0.0), self._normalised(self.shapes)
        assert self.polynomials is not None
        assert self.area is not None
        x, y = (np.linspace(low, high, GRID) for low, high in self.area)
        places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
        values = power_shapes(self._normalised(self.polynomials), self.area).at(places)
        return places, values[:, 2:] if self.out_of_plane else values

    @staticmethod
    def _stacked(values: Array) -> Array:
        return values[:, 0] if values.shape[1] == 1 else values

    def __repr__(self) -> str:
        source = f"{len(self.points)} nodes" if self.points is not None else "polynomials"
        modes = f"{self.n_flex} flexible mode{'s' if self.n_flex > 1 else ''}"
        first = self.frequency_hz[self.n_zero]
        return f"ModeData({source}, {modes} from {first:g} Hz, {self.n_zero} at zero frequency, {self.body.mass:g} kg)"
