from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DomainError
from lpvhinf.hinfstruct.norm import hinf_norm
from lpvhinf.lpv.farkas import certificate
from lpvhinf.lpv.linear_solve import factored, refined
from lpvhinf.lpv.lmi import LMIBlock, LMIProblem, MatrixUnknown, Term
from lpvhinf.lpv.operator import LMIOperator
from lpvhinf.lpv.solve_lmi import solve_lmi
from lpvhinf.lpv.verdict import lower_bound
from lpvhinf.progress import Progress
from tests.lpv.lmi_problems import gain_problem, positive_stack


def stable_system(seed: int, n: int = 5) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A -= (np.max(np.linalg.eigvals(A).real) + 0.2) * np.eye(n)
    return A, rng.normal(size=(n, 2)), rng.normal(size=(2, n))


@pytest.mark.parametrize("seed", range(5))
def test_gain_of_a_system_is_its_hinf_norm(seed: int) -> None:
    A, B, C = stable_system(seed)
    solution = solve_lmi(gain_problem(A, B, C))
    norm = hinf_norm(A, B, C, np.zeros((2, 2))).norm
    assert solution.status == "optimal"
    assert solution.margin > 0.0
    assert norm * (1.0 - 1e-9) <= solution.gamma <= norm * (1.0 + 2e-5)
    assert norm * (1.0 - 1e-3) <= solution.gamma_lower <= norm * (1.0 + 1e-9)


def test_eigenvalues_are_those_of_the_problem() -> None:
    problem = gain_problem(*stable_system(7))
    solution = solve_lmi(problem)
    for block in problem.blocks:
        Z = block.evaluate(solution.unknowns, solution.gamma)
        assert solution.eigenvalues[block.name][0] == pytest.approx(np.linalg.eigvalsh(Z)[0, 0])


@pytest.mark.parametrize("seed", range(3))
def test_random_problem_with_known_solution(seed: int) -> None:
    # complementary X and Z at a chosen point, F0 and gamma's weight chosen so that it is optimal
    rng = np.random.default_rng(seed)
    n, s, m = 3, 6, 4
    V, U, value = rng.normal(size=(m, s, n)), rng.normal(size=(m, s, n)), rng.normal(size=(m, 2))
    Q = np.linalg.qr(rng.normal(size=(m, s, s)))[0]
    X = Q[:, :, :3] @ Q[:, :, :3].swapaxes(1, 2)
    Z = Q[:, :, 3:] @ Q[:, :, 3:].swapaxes(1, 2)
    Fg = positive_stack(rng, m, s)
    Fg /= float(np.vdot(Fg, X))
    draft = LMIProblem(
        unknowns=[MatrixUnknown(name="Y", size=n, count=2, bound=1e3)],
        blocks=[
            LMIBlock(name="a", F0=np.zeros((m, s, s)), Fg=Fg, terms=[Term("Y", V, U, value)]),
            LMIBlock(name="b", F0=np.zeros((2, n, n)), terms=[Term("Y", np.eye(n), inner=np.eye(2))]),
        ],
    )
    Y = np.stack([M + M.T for M in rng.normal(size=(2, n, n))])
    left = LMIOperator(draft).adjoint_matrices([X, np.zeros((2, n, n))])[0]["Y"]
    # the second block takes up what the first leaves: its multiplier is -left, made positive by a third with +left
    shift = (np.abs(np.linalg.eigvalsh(left)).max() + 1.0) * np.eye(n)
    blocks = [
        replace(draft.blocks[0], F0=Z - draft.blocks[0].evaluate({"Y": Y}, 0.7)),
        LMIBlock(name="b", F0=-Y, terms=[Term("Y", np.eye(n), inner=np.eye(2))]),
        LMIBlock(name="c", F0=Y, terms=[Term("Y", np.eye(n), inner=-np.eye(2))]),
    ]
    problem = LMIProblem(unknowns=draft.unknowns, blocks=blocks)
    multipliers = [X, shift - left, np.tile(shift, (2, 1, 1))]
    assert lower_bound(LMIOperator(problem), multipliers) == pytest.approx(0.7, abs=1e-9)
    # b and c fix Y, so that no point is strictly inside; a little room makes the problem regular and moves gamma little
    blocks[1:] = [replace(block, F0=block.F0 + 1e-3 * np.eye(n)) for block in blocks[1:]]
    solution = solve_lmi(replace(problem, blocks=blocks))
    room = 1e-3 * float(np.abs(np.linalg.eigvalsh(left)).sum())
    assert solution.status == "optimal"
    assert 0.7 - room - 1e-4 <= solution.gamma <= 0.7 + 1e-4


def test_unstable_system_is_infeasible_with_a_certificate_that_can_be_checked() -> None:
    A, B, C = stable_system(0)
    problem = gain_problem(A + 0.5 * np.eye(5), B, C)
    solution = solve_lmi(problem)
    assert solution.status == "infeasible"
    assert solution.gamma == np.inf
    shown = solution.certificate
    assert shown is not None
    for X in shown.multipliers:
        assert np.linalg.eigvalsh(X).min() >= -1e-12
    # for every feasible point the inner product with the multipliers would be nonnegative; here it is negative
    rng = np.random.default_rng(0)
    for _ in range(20):
        Y = 0.1 * positive_stack(rng, 1, 5)
        Z = problem.evaluate({"X": Y}, 100.0)
        assert sum(float(np.vdot(x, z)) for x, z in zip(shown.multipliers, Z, strict=True)) < 0.0


def test_certificate_is_refused_when_corrupted() -> None:
    A, B, C = stable_system(0)
    problem = gain_problem(A + 0.5 * np.eye(5), B, C)
    shown = solve_lmi(problem).certificate
    assert shown is not None
    multipliers = [np.array(X) for X in shown.multipliers]
    assert certificate(problem, multipliers) is not None
    assert certificate(gain_problem(A, B, C), multipliers) is None
    multipliers[0] = multipliers[0] - 1e-3 * np.abs(multipliers[0]).max() * np.eye(9)
    assert certificate(problem, multipliers) is None


def test_lower_bound_grows_worse_with_residuals_and_never_passes_gamma() -> None:
    A, B, C = stable_system(1)
    problem = gain_problem(A, B, C)
    operator = LMIOperator(problem)
    norm = hinf_norm(A, B, C, np.zeros((2, 2))).norm
    rng = np.random.default_rng(0)
    for _ in range(20):
        X = [positive_stack(rng, block.m, block.size) for block in problem.blocks]
        assert lower_bound(operator, X) <= norm


def test_stops_early_for_design_with_matrices_inside_the_cone() -> None:
    problem = gain_problem(*stable_system(3))
    early, late = solve_lmi(problem, gap=1e-2), solve_lmi(problem, gap=1e-6)
    assert early.status == late.status == "optimal"
    assert late.gamma < early.gamma <= 1.02 * late.gamma
    assert early.margin > 10.0 * late.margin
    assert early.iterations < late.iterations


def test_limits_end_the_run_without_a_claim() -> None:
    problem = gain_problem(*stable_system(3))
    few = solve_lmi(problem, max_iterations=2)
    assert few.status == "not solved"
    assert few.gamma == np.inf
    assert "limit of iterations" in few.message
    short = solve_lmi(problem, time_limit=1e-9)
    assert short.status == "not solved"
    assert "time is over" in short.message


def test_unbounded_problem_is_not_called_solved() -> None:
    # gamma may fall without end
    block = LMIBlock(name="b", F0=np.eye(2)[None], Fg=np.diag([0.0, -1.0])[None], terms=[Term("Y", np.eye(2))])
    problem = LMIProblem(unknowns=[MatrixUnknown(name="Y", size=2)], blocks=[block])
    assert solve_lmi(problem).status in ("feasible", "not solved")


def test_progress_is_told() -> None:
    class Listener(Progress):
        def __init__(self) -> None:
            self.gammas: list[float] = []

        def update(self, advance: int = 1, **values: float) -> None:
            self.gammas.append(values["gamma"])

    listener = Listener()
    solution = solve_lmi(gain_problem(*stable_system(0)), progress=listener)
    assert len(listener.gammas) == solution.iterations


def test_bad_arguments_are_named() -> None:
    problem = gain_problem(*stable_system(0))
    with pytest.raises(DomainError, match="solver is 'magic'"):
        solve_lmi(problem, solver="magic")
    with pytest.raises(DomainError, match="gap is 0"):
        solve_lmi(problem, gap=0.0)
    with pytest.raises(DomainError, match="max_iterations"):
        solve_lmi(problem, max_iterations=0)
    with pytest.raises(AssumptionError, match="no block of the problem contains gamma"):
        solve_lmi(problem.at_level(1.0))


def test_huge_system_is_solved_in_place_and_refined() -> None:
    rng = np.random.default_rng(0)
    n = 600  # more rows than are scaled at a time
    factor = rng.normal(size=(n, n))
    scale = 10.0 ** rng.uniform(-4, 4, n)
    M = scale * (factor @ factor.T + np.eye(n)) * scale[:, None]
    r = rng.normal(size=n) * scale

    def assemble(H: Array) -> None:
        H[:] = np.tril(M)

    found = factored(assemble, np.zeros((n, n)))
    assert found is not None
    assert found.level == 0
    d, error, before = refined(found, lambda v: M @ v, r, 5)
    assert error <= before
    assert error < 1e-12
    np.testing.assert_allclose(M @ d / scale, r / scale, atol=1e-9)


def test_semidefinite_system_is_regularised_and_an_indefinite_one_refused() -> None:
    def semidefinite(H: Array) -> None:
        H[:] = np.ones((4, 4)) - 1e-15 * np.eye(4)

    def indefinite(H: Array) -> None:
        H[:] = np.array([[1.0, 0.0], [2.0, 1.0]])

    found = factored(semidefinite, np.zeros((4, 4)))
    assert found is not None
    assert found.level > 0
    assert factored(indefinite, np.zeros((2, 2))) is None
