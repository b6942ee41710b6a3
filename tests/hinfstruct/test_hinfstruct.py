"""The synthesis: known optima, several plants, failure, limits, bad input."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lpvhinf.checks import Array
from lpvhinf.errors import AssumptionError, DimensionError, DomainError, SynthesisError
from lpvhinf.hinfstruct import DiagonalGain, FixedOrder, HinfstructResult, StaticGain, hinf_norm, hinfstruct
from lpvhinf.progress import Progress
from lpvhinf.statespace.generalized import GeneralizedPlant
from tests.hinfstruct.plants import first_order, random_plant


def integrator(gain: float = 1.0) -> GeneralizedPlant:
    """x' = w + gain u, z = (x, u), y = x: with u = -k x the norm is sqrt(1 + k^2) / (gain k)."""
    return GeneralizedPlant(
        [[0.0]], [[1.0]], [[gain]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 1)), [[0.0], [1.0]], [[0.0]]
    )


def with_noise() -> GeneralizedPlant:
    """x' = w1 + u, z = (x, u), y = x + w2.

    With u = -k y the loop from (w1, w2) to (x, u) is 1 / (s + k) [[1, -k], [-k, -k s]]: at zero
    (1/k, -1; -1, 0), at infinity (0, 0; 0, -k); the norm is minimal where both singular values are equal.
    """
    return GeneralizedPlant(
        [[0.0]], [[1.0, 0.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], np.zeros((2, 2)), [[0.0], [1.0]], [[0.0, 1.0]]
    )


def norms(result: HinfstructResult, plants: list[GeneralizedPlant]) -> list[float]:
    K = result.controller
    return [hinf_norm(*P.close(K.A, K.B, K.C, K.D)).norm for P in plants]


def test_static_gain_with_a_known_optimum() -> None:
    result = hinfstruct(with_noise(), StaticGain(1, 1), starts=2)
    # sigma_max at zero: with a = 1/k, (a + sqrt(a^2 + 4)) / 2; at infinity k; equal at k = sqrt 2
    assert result.gamma == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert result.parameters[0] == pytest.approx(-np.sqrt(2.0), rel=1e-5)
    assert result.stabilizing
    assert result.optimality < 1e-4
    assert "local minimum" in result.status
    assert result.gamma_worst == result.gamma
    assert result.worst_position is None
    assert result.lower_bound is not None
    assert 0.0 <= result.lower_bound <= result.gamma
    assert {record.phase for record in result.history} == {"stabilise", "descend", "polish"}


def test_kalman_filter_bound_is_reached_by_a_first_order_controller() -> None:
    # full-order optimum of the same plant; a first-order controller contains the static one
    static = hinfstruct(with_noise(), StaticGain(1, 1), starts=1).gamma
    result = hinfstruct(with_noise(), FixedOrder(1, 1, 1), starts=2, seed=1)
    assert result.gamma <= static * (1.0 + 1e-6)
    assert result.controller.nstates == 1


def test_largest_norm_over_plants_counts() -> None:
    plants = [random_plant(k, with_D22=True) for k in range(3)]
    result = hinfstruct(plants, StaticGain(2, 2), starts=2)
    np.testing.assert_allclose(norms(result, plants), result.gammas, rtol=1e-7)
    assert result.gamma == pytest.approx(np.max(result.gammas), rel=1e-12)
    alone = [hinfstruct(P, StaticGain(2, 2), starts=1, initial=result.parameters).gamma for P in plants]
    assert result.gamma >= max(alone) * (1.0 - 1e-6)
    # a local minimum: no small random step is better
    rng = np.random.default_rng(0)
    for _ in range(20):
        D = (result.parameters + 1e-3 * rng.standard_normal(4)).reshape(2, 2)
        other = [hinf_norm(*P.close(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), D)).norm for P in plants]
        assert max(other) >= result.gamma * (1.0 - 1e-5)


def test_similarity_of_the_plant_does_not_matter() -> None:
    P = random_plant(7)
    rng = np.random.default_rng(0)
    S = np.linalg.qr(rng.standard_normal((P.n_x, P.n_x)))[0] * np.geomspace(0.1, 10.0, P.n_x)
    Si = np.linalg.inv(S)
    Q = GeneralizedPlant(Si @ P.A @ S, Si @ P.B1, Si @ P.B2, P.C1 @ S, P.C2 @ S, P.D11, P.D12, P.D21, P.D22)
    a, b = (hinfstruct(plant, StaticGain(2, 2), starts=1).gamma for plant in (P, Q))
    assert a == pytest.approx(b, rel=1e-3)


def test_log_parameters_and_several_gains() -> None:
    # both loops want the gain 1/gain * 1: the worst of the two decides
    result = hinfstruct([with_noise(), with_noise()], DiagonalGain(1, sign=-1), starts=1)
    assert np.exp(result.parameters[0]) == pytest.approx(np.sqrt(2.0), rel=1e-5)


def test_minimum_at_infinite_gain_is_reported_as_such() -> None:
    result = hinfstruct(integrator(), StaticGain(1, 1), starts=1)
    assert 1.0 < result.gamma < 1.01


def test_scheduled_structure_gets_the_positions() -> None:
    class Inverse(StaticGain):
        def realize(self, theta: Array, p: Array | None = None) -> tuple[Array, Array, Array, Array]:
            assert p is not None
            A, B, C, D = super().realize(theta)
            return A, B, C, D / p[0]

        def pullback(self, theta: Array, GA: Array, GB: Array, GC: Array, GD: Array, p: Array | None = None) -> Array:
            assert p is not None
            return super().pullback(theta, GA, GB, GC, GD) / p[0]

    def scaled(g: float) -> GeneralizedPlant:
        P = with_noise()
        return GeneralizedPlant(P.A, P.B1, g * P.B2, P.C1, P.C2, P.D11, g * P.D12, P.D21)

    result = hinfstruct([scaled(1.0), scaled(4.0)], Inverse(1, 1), points=[[1.0], [4.0]], starts=1)
    assert result.gamma == pytest.approx(np.sqrt(2.0), rel=1e-5)
    assert result.worst_position is not None
    assert result.worst_position.shape == (1,)


def test_a_plant_that_cannot_be_stabilised() -> None:
    # the unstable pole is not controllable
    plant = GeneralizedPlant(
        np.diag([1.0, -1.0]),
        np.ones((2, 1)),
        [[0.0], [1.0]],
        np.ones((1, 2)),
        np.ones((1, 2)),
        [[0.0]],
        [[0.0]],
        [[0.0]],
    )
    with pytest.raises(AssumptionError, match=r"plants\[0\] is not stabilisable.* 1 rad/s"):
        hinfstruct(plant, StaticGain(1, 1), starts=1)
    dual = GeneralizedPlant(plant.A.T, plant.B1, plant.C2.T, plant.C1, plant.B2.T, plant.D11, plant.D12, plant.D21)
    with pytest.raises(AssumptionError, match=r"not detectable.* 1 rad/s"):
        hinfstruct(dual, StaticGain(1, 1), starts=1)


def test_a_structure_that_cannot_stabilise_the_plant() -> None:
    # an inverted pendulum with its angle alone: a static gain leaves undamped poles
    plant = GeneralizedPlant(
        [[0.0, 1.0], [1.0, 0.0]], [[0.0], [1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[1.0, 0.0]], [[0.0]], [[0.0]], [[0.0]]
    )
    with pytest.raises(SynthesisError, match=r"abscissa reached is .*unstable closed-loop modes") as caught:
        hinfstruct(plant, StaticGain(1, 1), starts=1)
    assert caught.value.result.stabilizing is False
    assert caught.value.result.gamma == np.inf


class Stopper(Progress):
    """Interrupts once a norm was heard, as Ctrl-C would."""

    def __init__(self, phase: str = "gamma") -> None:
        self.phase = phase

    def update(self, advance: int = 1, **values: float) -> None:
        if self.phase in values:
            raise KeyboardInterrupt


def test_interruption_returns_the_best_so_far() -> None:
    result = hinfstruct(random_plant(3), StaticGain(2, 2), starts=3, progress=Stopper())
    assert result.stabilizing
    assert "interrupted" in result.status
    assert result.interrupted
    assert result.gamma == pytest.approx(norms(result, [random_plant(3)])[0], rel=1e-9)


def test_interruption_before_a_stabilising_controller_is_passed_on() -> None:
    with pytest.raises(KeyboardInterrupt):
        hinfstruct(first_order(), StaticGain(1, 1), initial=[5.0], starts=0, progress=Stopper("abscissa"))


INTERRUPTED = """
import os, signal, threading, numpy as np
from lpvhinf import StaticGain, hinfstruct
from lpvhinf.progress import Progress
from tests.hinfstruct.plants import random_plant

class Killer(Progress):
    def stage(self, name, total=None):
        threading.Timer(6.0, os.kill, (os.getpid(), signal.SIGINT)).start()

if __name__ == "__main__":
    plants = [random_plant(k, n=30) for k in range(8)]
    result = hinfstruct(plants, StaticGain(2, 2), starts=40, jobs=2, max_iterations=1000, progress=Killer())
    print(result.stabilizing, "interrupted" in result.status)
    os._exit(0)
"""


@pytest.mark.slow
def test_interruption_of_processes(tmp_path: Path) -> None:
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.split() == ["True", "True"], done.stderr


def test_evaluations_are_counted() -> None:
    plants = [random_plant(k) for k in range(6)]
    result = hinfstruct(plants, StaticGain(2, 2), starts=2)
    spent = result.evaluations
    assert spent.every_model >= 6 * (
        spent.trials - sum(r.evaluations for r in result.history if r.phase == "stabilise")
    )
    assert 0 < spent.exact < spent.every_model


def test_default_starts_agree_on_the_minimum() -> None:
    result = hinfstruct(with_noise(), StaticGain(1, 1))
    assert result.gamma == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert len({record.start for record in result.history}) >= 3


def test_time_limit_is_respected() -> None:
    plants = [random_plant(k, n=12) for k in range(4)]
    started = time.monotonic()
    result = hinfstruct(plants, FixedOrder(4, 2, 2), starts=50, time_limit=2.0)
    assert time.monotonic() - started < 10.0
    assert result.stabilizing


def test_same_seed_same_result() -> None:
    a, b = (hinfstruct(random_plant(3), StaticGain(2, 2), starts=2, seed=5, max_iterations=40) for _ in range(2))
    assert a.gamma == b.gamma
    np.testing.assert_array_equal(a.parameters, b.parameters)


@pytest.mark.slow
def test_processes_give_the_same_result() -> None:
    a = hinfstruct(random_plant(3), StaticGain(2, 2), starts=2, seed=5, max_iterations=40)
    b = hinfstruct(random_plant(3), StaticGain(2, 2), starts=2, seed=5, max_iterations=40, jobs=2)
    np.testing.assert_array_equal(a.parameters, b.parameters)


def test_initial_is_tried_first_and_listeners_hear() -> None:
    class Recorder(Progress):
        def __init__(self) -> None:
            self.stages: list[str] = []
            self.gammas: list[float] = []

        def stage(self, name: str, total: int | None = None) -> None:
            self.stages.append(name)

        def update(self, advance: int = 1, **values: float) -> None:
            self.gammas.append(values.get("gamma", np.inf))

    recorder, saved = Recorder(), []
    result = hinfstruct(
        with_noise(),
        StaticGain(1, 1),
        initial=[-1.0],
        starts=0,
        progress=recorder,
        checkpoint=lambda theta, gamma: saved.append((theta, gamma)),
    )
    assert result.gamma == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert len(recorder.stages) == 2
    assert recorder.gammas
    gammas = [gamma for _, gamma in saved]
    assert gammas == sorted(gammas, reverse=True)
    assert gammas[-1] == pytest.approx(result.gamma, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial": [np.nan]}, "initial"),
        ({"initial": [1.0, 2.0]}, "n_parameters"),
        ({"constraints": ("poles",)}, "wanted a goal"),
        ({"starts": 0}, "starts is 0"),
        ({"jobs": 0}, "jobs is 0"),
        ({"time_limit": -1.0}, "time_limit"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"points": [[0.0], [1.0]]}, "points"),
    ],
)
def test_bad_options(options: dict[str, object], message: str) -> None:
    with pytest.raises((DomainError, DimensionError), match=message):
        hinfstruct(first_order(), StaticGain(1, 1), **options)  # type: ignore[arg-type]


def test_bad_plants_and_controllers() -> None:
    with pytest.raises(DomainError, match="plants"):
        hinfstruct([], StaticGain(1, 1))
    with pytest.raises(DomainError, match="from_control"):
        hinfstruct("plant", StaticGain(1, 1))  # type: ignore[arg-type]
    with pytest.raises(DimensionError, match="Make them equal"):
        hinfstruct(first_order(), StaticGain(2, 1))
    with pytest.raises(DomainError, match="protocol"):
        hinfstruct(first_order(), 3.0)  # type: ignore[arg-type]


UNGUARDED = """
import numpy as np
from lpvhinf import StaticGain, hinfstruct
from tests.hinfstruct.plants import first_order

hinfstruct(first_order(), StaticGain(1, 1), starts=2, jobs=2)
"""


def test_a_script_without_guard_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED)
    root = Path(__file__).parents[2]
    run = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(root)},
    )
    assert run.returncode != 0
    assert 'call this under `if __name__ == "__main__":`' in run.stderr
