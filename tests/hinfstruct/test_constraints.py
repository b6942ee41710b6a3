"""hinfstruct with hard constraints, other objectives, lower bounds and plants over a box."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.errors import DomainError, SynthesisError
from lpvhinf.hinfstruct import ChannelNorm, ClosedLoopPoles, FixedOrder, H2Norm, StaticGain, hinf_norm, hinfstruct
from lpvhinf.statespace import GeneralizedPlant, LPVGeneralizedPlant, LPVStateSpace

# x' = x + w1 + u, z = (x, u), y = x + w2, u = -k y: the loop has the pole 1 - k
P = GeneralizedPlant(
    [[1.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 2)), [[0.0], [1.0]], [[0.0, 1.0]]
)
FREE = 1.0 + np.sqrt(3.0)


def test_inactive_constraint_changes_nothing():
    result = hinfstruct(P, StaticGain(1, 1), starts=2, constraints=[ChannelNorm(outputs=0, inputs=0, at_most=1.0)])
    assert result.gamma == pytest.approx(FREE, rel=1e-5)
    assert result.constraints[0].level < 0.0


def test_active_channel_constraint():
    # |x / w1| = 1 / (k - 1) <= 0.4 asks for k >= 3.5; the norm then is that of u / (w1, w2)
    goal = ChannelNorm(outputs=0, inputs=0, at_most=0.4)
    result = hinfstruct(P, StaticGain(1, 1), starts=2, constraints=[goal])
    assert result.parameters[0] == pytest.approx(-3.5, rel=1e-4)
    assert result.constraints[0].value <= 0.4
    k = -result.parameters[0]
    A, B, C, D = np.array([[1 - k]]), np.array([[1.0, -k]]), np.array([[1.0], [-k]]), np.array([[0, 0], [0, -k]])
    assert result.gamma == pytest.approx(hinf_norm(A, B, C, D).norm, rel=1e-9)
    assert result.gamma > FREE


def test_pole_constraint():
    result = hinfstruct(P, StaticGain(1, 1), starts=2, constraints=[ClosedLoopPoles(decay=4.0)])
    assert result.parameters[0] == pytest.approx(-5.0, rel=1e-4)  # 1 - k <= -4
    assert np.max((P.A + P.B2 * result.parameters[0] @ P.C2).real) <= -4.0


def test_h2_objective():
    # x / w1 and u / w1 have the H2 norm sqrt((1 + k^2) / (2 (k - 1))), least at k = 1 + sqrt 2
    result = hinfstruct(P, StaticGain(1, 1), starts=2, objective=H2Norm(inputs=0))
    k = 1.0 + np.sqrt(2.0)
    assert result.parameters[0] == pytest.approx(-k, rel=1e-4)
    assert result.objective == pytest.approx(np.sqrt((1 + k**2) / (2 * (k - 1))), rel=1e-6)


def test_constraints_that_cannot_be_met():
    with pytest.raises(SynthesisError, match=r"no start meets the constraints: constraints\[0\] reaches") as error:
        hinfstruct(P, StaticGain(1, 1), starts=2, constraints=[ChannelNorm(outputs=1, inputs=1, at_most=0.5)])
    assert error.value.result.constraints[0].level > 0.0


def test_goals_are_checked():
    with pytest.raises(DomainError, match=r"constraints\[0\] has no bound"):
        hinfstruct(P, StaticGain(1, 1), constraints=[ChannelNorm(outputs=0)])
    with pytest.raises(DomainError, match="objective has a bound"):
        hinfstruct(P, StaticGain(1, 1), objective=H2Norm(inputs=0, at_most=1.0))
    with pytest.raises(DomainError, match=r"constraints\[0\] is a str"):
        hinfstruct(P, StaticGain(1, 1), constraints=["fast"])  # type: ignore[list-item]


def test_lower_bound_is_below_and_reached_by_full_order():
    static = hinfstruct(P, StaticGain(1, 1), starts=2)
    full = hinfstruct(P, FixedOrder(1, 1, 1), starts=4)
    assert static.lower_bound == pytest.approx(full.lower_bound)
    assert static.lower_bound <= full.gamma * (1 + 1e-9)
    assert full.gamma <= static.gamma * (1 + 1e-6)
    assert hinfstruct(P, StaticGain(1, 1), starts=1, bound=False).lower_bound is None


def test_a_plant_over_a_box():
    # x' = (1 + p) x + ...: the worst position is the most unstable one, p = 1
    def system(p: float) -> GeneralizedPlant:
        return GeneralizedPlant([[1.0 + p]], P.B1, P.B2, P.C1, P.C2, P.D11, P.D12, P.D21)

    B, C = np.hstack([P.B1, P.B2]), np.vstack([P.C1, P.C2])
    D = np.block([[P.D11, P.D12], [P.D21, np.zeros((1, 1))]])
    whole = LPVStateSpace.from_coefficients([[[1.0]], [[1.0]]], B, C, D, box=[[-0.5, 1.0]], basis="power")
    result = hinfstruct(LPVGeneralizedPlant(whole, n_u=1, n_y=1), StaticGain(1, 1), starts=2)
    frozen = hinfstruct([system(p) for p in np.linspace(-0.5, 1.0, 7)], StaticGain(1, 1), starts=2)
    assert result.gamma_worst == pytest.approx(frozen.gamma, rel=1e-3)
    assert result.worst_position == pytest.approx([1.0], abs=1e-6)
