"""Guards the ranges, and what a point of the unit cube means."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.robustness import ControlledPlant, Samples, Uncertainty


def test_samples_lie_in_their_ranges_and_reach_the_ends(actuator: ControlledPlant) -> None:
    plant, given = actuator.plant, Uncertainty()
    d = given.dimension(plant)
    assert d == len(given.names(plant)) == 3 * 3 + 4 + 2 + 2
    found = given.samples(plant, np.vstack([np.zeros(d), np.ones(d), np.random.default_rng(0).random((500, d))]))
    ranges = {"zeta": (1e-3, 1e-2), "mass": (0.98, 1.02), "modal_mass": (0.98, 1.02), "misalignment": (-5e-5, 5e-5)}
    for name, (low, high) in ranges.items():
        values = getattr(found, name)
        assert values[0] == pytest.approx(np.full(values.shape[1], low))
        assert values[1] == pytest.approx(np.full(values.shape[1], high))
        assert np.all((values >= low * (1 - np.sign(low) * 1e-12)) & (values <= high * (1 + 1e-12)))
    assert found.omega[:2] == pytest.approx(np.outer([0.98, 1.02], plant.omega[6:]))
    assert found.position[:2] == pytest.approx(plant.box.T)
    assert np.min(np.abs(found.misalignment)) >= 5e-6 * (1 - 1e-12)
    assert 0.3 < np.mean(found.misalignment > 0.0) < 0.7
    # uniform in the logarithm: half of all are below the geometric mean
    assert np.mean(found.zeta[2:] < np.sqrt(1e-5)) == pytest.approx(0.5, abs=0.05)
    assert np.all(found.mass[:, :3] == found.mass[:, :1])  # one mass, three inertias
    assert np.all(found.mass[2:, 3:5] != found.mass[2:, 4:6])


def test_axes_share_masses_as_they_are_told(small: ControlledPlant) -> None:
    together = Uncertainty(mass_groups=((0, 1),))
    d = together.dimension(small.plant)
    assert d == Uncertainty().dimension(small.plant) - 1
    mass = together.samples(small.plant, np.random.default_rng(0).random((5, d))).mass
    assert np.all(mass[:, 0] == mass[:, 1])
    with pytest.raises(DomainError, match=r"mass_groups is \(\(0,\),\), wanted every axis 0 to 1 in one group"):
        Uncertainty(mass_groups=((0,),)).dimension(small.plant)


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        ({"damping": (0.0, 0.01)}, DomainError, "damping is .* wanted values from 1e-09 to 0.99: they are damping"),
        ({"damping": (0.01, 0.001)}, DomainError, r"damping is \(0.01, 0.001\), wanted \(lowest, highest\)"),
        ({"frequency": 0.02}, DimensionError, r"frequency has shape \(\), wanted \(2\)"),
        ({"mass": (-2.0, 2.0)}, DomainError, "mass is .* relative deviation, 0.02 for 2 %"),
        ({"misalignment": (-5e-6, 5e-5)}, DomainError, "misalignment is .* m, wanted values from 0 to 0.05 m"),
        ({"misalignment": (5.0, 50.0)}, DomainError, "misalignment"),
        ({"delay": -1e-4}, DomainError, r"delay is -0.0001 s, wanted 0 to 0.1 s"),
        ({"delay_order": 0}, DomainError, "delay_order is 0"),
        ({"sample_time": 0.0}, DomainError, "sample_time is 0.0, wanted a finite number above 0 s"),
        ({"damping": (np.nan, 0.1)}, DomainError, r"damping\[0\] is nan"),
    ],
)
def test_ranges_that_cannot_be(wrong: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Uncertainty(**wrong)


def test_points_that_are_none_of_the_cube(small: ControlledPlant) -> None:
    with pytest.raises(DimensionError, match=r"unit has shape \(1, 3\), wanted \(N, 13\)"):
        Uncertainty().samples(small.plant, np.zeros((1, 3)))
    with pytest.raises(DomainError, match="unit has entries from 2 to 2, wanted 0 to 1"):
        Uncertainty().samples(small.plant, np.full((1, 13), 2.0))


def test_samples_are_checked(small: ControlledPlant) -> None:
    good = Samples.nominal(small.plant, [[0.0], [0.1]])
    assert len(good) == 2
    assert len(good.take(1)) == 1
    assert good.take(1).position.tolist() == [[0.1]]
    for wrong, error, message in (
        ({"omega": good.omega[:, :2]}, DimensionError, r"omega has shape \(2, 2\), wanted \(2, 3\)"),
        ({"mass": 0.0 * good.mass}, DomainError, "mass has the entry 0, wanted entries above 0"),
        ({"zeta": good.zeta + 1.0}, DomainError, r"zeta has entries outside \[0, 1\)"),
        ({"position": good.position[:1]}, DimensionError, "shape"),
    ):
        with pytest.raises(error, match=message):
            dataclasses.replace(good, **wrong)
    with pytest.raises(DomainError, match="outside the box"):
        Samples.nominal(small.plant, [[0.3]])


def test_controllers_that_do_not_fit(small: ControlledPlant, actuator: ControlledPlant) -> None:
    with pytest.raises(DimensionError, match=r"controller has 15 inputs, wanted 5: e \(2\) and y \(3\)"):
        dataclasses.replace(small, controller=actuator.controller)
    with pytest.raises(DimensionError, match=r"scaling has 9 outputs and 7 inputs, wanted 3 and 3"):
        dataclasses.replace(small, scaling=actuator.scaling)
    K = small.controller
    narrow = type(K).from_coefficients(*(m[0] for m in K.sample([[0.0]])), box=[[-0.05, 0.05]])
    with pytest.raises(DomainError, match=r"controller has the box .*, wanted all of the plant's"):
        dataclasses.replace(small, controller=narrow)
    A, B, C, D = (m[0] for m in K.sample([[0.0]]))
    with pytest.raises(DimensionError, match=r"controller has 1 outputs, wanted 2 \(u_RB\) or 3 \(u_RB and u_FM\)"):
        dataclasses.replace(small, controller=type(K).from_coefficients(A, B, C[:1], D[:1], box=K.box))
    with pytest.raises(DomainError, match=r"design is a int, wanted a Design or a ControlledPlant"):
        ControlledPlant.of(3)  # type: ignore[arg-type]
    assert ControlledPlant.of(small) is small
