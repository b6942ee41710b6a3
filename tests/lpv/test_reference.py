"""The structured method against the same problem through cvxpy."""

from __future__ import annotations

import numpy as np
import pytest

from lpvhinf.errors import DomainError
from lpvhinf.hinfstruct.norm import hinf_norm
from lpvhinf.lpv.gridded import gridded_lmis
from lpvhinf.lpv.reference import installed, reference_solution
from lpvhinf.lpv.solve_lmi import solve_lmi
from tests.lpv.lmi_problems import gain_problem
from tests.lpv.small_plants import cosines, moving_mode, random_plant


def test_both_find_the_norm_of_a_system() -> None:
    A = np.array([[-1.0, 4.0], [-4.0, -1.0]])
    problem = gain_problem(A, np.eye(2), np.eye(2))
    norm = hinf_norm(A, np.eye(2), np.eye(2), np.zeros((2, 2))).norm
    reference = solve_lmi(problem, solver="clarabel")
    assert reference.solver == "clarabel"
    assert reference.gamma == pytest.approx(norm, rel=1e-4)
    assert reference.gamma >= norm
    assert solve_lmi(problem).gamma == pytest.approx(norm, rel=2e-5)


@pytest.mark.parametrize("seed", range(3))
def test_same_synthesis_gamma_for_random_plants(seed: int) -> None:
    problem = gridded_lmis(
        [random_plant(seed), random_plant(seed + 10)], [0.0, 1.0], constant="both", r_max=1e3
    ).problem
    ours, reference = solve_lmi(problem), solve_lmi(problem, solver="clarabel")
    assert ours.status == "optimal"
    assert reference.usable
    assert ours.gamma == pytest.approx(reference.gamma, rel=1e-4)
    assert ours.gamma_lower <= reference.gamma


def test_same_gamma_with_basis_functions_and_rates() -> None:
    points = np.linspace(-1.0, 1.0, 3)
    plants = [moving_mode(np.array([p])) for p in points]
    problem = gridded_lmis(plants, points, basis=cosines, rate=0.3, constant="none", r_max=1e3).problem
    ours, reference = solve_lmi(problem), solve_lmi(problem, solver="clarabel")
    assert ours.status == "optimal"
    assert reference.usable
    assert ours.gamma == pytest.approx(reference.gamma, rel=2e-4)


def test_reference_does_not_guess_either() -> None:
    A = np.array([[0.5]])
    problem = gain_problem(A, np.eye(1), np.eye(1))
    reference = reference_solution(problem)
    assert reference.status in ("infeasible", "not solved")
    assert reference.gamma == np.inf
    assert (reference.certificate is not None) == (reference.status == "infeasible")


def test_solver_that_is_not_there_is_named() -> None:
    missing = [name for name in ("cvxopt", "sdpa", "scs") if name not in installed()]
    problem = gain_problem(-np.eye(1), np.eye(1), np.eye(1))
    for name in missing:
        with pytest.raises(DomainError, match=r"wanted one that is installed: .*clarabel"):
            solve_lmi(problem, solver=name)
