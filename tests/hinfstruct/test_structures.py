"""The structures obey the protocol, and the check finds one that does not."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError
from lpvhinf.hinfstruct import (
    BlockDiagonal,
    ControllerStructure,
    DiagonalGain,
    FixedOrder,
    Scaled,
    StaticGain,
    check_structure,
)

STRUCTURES = [
    StaticGain(2, 3),
    StaticGain(2, 2, mask=[[True, False], [True, True]]),
    DiagonalGain(3),
    DiagonalGain(2, sign=[1, -1]),
    FixedOrder(3, 2, 2),
    FixedOrder(4, 1, 2, form="tridiagonal", strictly_proper=True),
    BlockDiagonal(StaticGain(1, 2), FixedOrder(2, 2, 1), DiagonalGain(1, sign=1)),
    Scaled(FixedOrder(1, 2, 2), [2.0, 0.5], [10.0, 1.0]),
]


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: type(s).__name__)
def test_protocol_and_pullback(structure: ControllerStructure) -> None:
    assert isinstance(structure, ControllerStructure)
    theta = structure.initial(np.random.default_rng(1))
    assert theta.shape == (structure.n_parameters,)
    assert len(structure.names) == structure.n_parameters  # type: ignore[attr-defined]
    assert check_structure(structure, theta) < 1e-6


def test_random_fixed_order_is_stable() -> None:
    structure = FixedOrder(4, 1, 1)
    for seed in range(5):
        A = structure.realize(structure.initial(np.random.default_rng(seed)))[0]
        assert np.max(np.linalg.eigvals(A).real) < 0.0


def test_a_wrong_pullback_is_found() -> None:
    class Wrong(StaticGain):
        def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
            return 2.0 * super().pullback(theta, GA, GB, GC, GD, p)

    with pytest.raises(AssumptionError, match="central differences"):
        check_structure(Wrong(1, 2), [1.0, 2.0])


def test_wrong_sizes_are_found() -> None:
    class Wrong(StaticGain):
        def realize(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array, Array]:
            A, B, C, D = super().realize(theta, p)
            return A, B, C, D.T

    with pytest.raises(DimensionError, match="D of the controller structure"):
        check_structure(Wrong(1, 2), [1.0, 2.0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: StaticGain(0, 1),
        lambda: FixedOrder(1, 1, 1, form="companion"),
        lambda: FixedOrder(-1, 1, 1),
        lambda: DiagonalGain(2, sign=0.5),
        lambda: Scaled(StaticGain(1, 1), 0.0),
        lambda: Scaled(StaticGain(1, 1), [1.0, 2.0]),
    ],
)
def test_bad_arguments(make) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DomainError, match="wanted"):
        make()
    with pytest.raises(DimensionError, match="mask"):
        StaticGain(1, 2, mask=[[True]])
    with pytest.raises(DimensionError, match="blocks"):
        BlockDiagonal()
