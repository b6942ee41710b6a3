"""Guards the Monte Carlo runs: the same plants for any number of jobs, resumed where it was, exact where it matters."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lpvhinf.errors import DomainError, StorageError
from lpvhinf.hinfstruct import hinf_norm
from lpvhinf.progress import Progress
from lpvhinf.robustness import Analysis, ControlledPlant, MonteCarlo, Uncertainty, monte_carlo
from lpvhinf.robustness.chunk_store import fingerprint
from lpvhinf.robustness.monte_carlo import NORMS
from lpvhinf.robustness.outcomes import FIGURES
from lpvhinf.statespace import LPVStateSpace


class Counting(Progress):
    """Counts plants, and interrupts after some."""

    def __init__(self, limit: int = 10**9) -> None:
        self.done, self.limit, self.messages = 0, limit, list[str]()

    def update(self, advance: int = 1, **values: float) -> None:
        self.done += advance
        if self.done >= self.limit:
            raise KeyboardInterrupt

    def log(self, message: str) -> None:
        self.messages.append(message)


def same(one: MonteCarlo, other: MonteCarlo) -> None:
    n = min(len(one), len(other))
    assert np.array_equal(one.unit[:n], other.unit[:n])
    for name in ("abscissa", "spectral_radius", "damping", "least_damping"):  # norms: some are exact in one of them
        assert np.array_equal(getattr(one.outcomes, name)[:n], getattr(other.outcomes, name)[:n])


@pytest.fixture(scope="module")
def run(small: ControlledPlant, wide: Uncertainty) -> MonteCarlo:
    return monte_carlo(small, wide, 115, seed=3)


def test_it_is_a_matter_of_the_seed(run: MonteCarlo, small: ControlledPlant, wide: Uncertainty) -> None:
    same(run, monte_carlo(small, wide, 70, seed=3))
    assert not np.array_equal(run.unit[:5], monte_carlo(small, wide, 5, seed=4).unit)
    assert len(run) == len(run.samples) == len(run.outcomes) == 115
    assert 0 < np.sum(run.outcomes.unstable) < 115


def test_figures_are_those_of_each_plant_alone(run: MonteCarlo) -> None:
    analysis = Analysis(run.subject, run.uncertainty)
    for i in (0, 49, 114):
        alone = analysis.measure(run.samples.take(i))
        for name in FIGURES:
            tolerance = 1e-2 if name in NORMS else 1e-9  # some norms are exact in one of them
            assert run.outcomes.figure(name)[i] == pytest.approx(alone.figure(name)[0], rel=tolerance)


def test_the_largest_norms_are_exact(small: ControlledPlant, mild: Uncertainty) -> None:
    run = monte_carlo(small, mild, 40, n_exact=2)
    worst = run.worst("sensitivity", 2)
    assert set(worst) <= set(run.recomputed)
    loops = Analysis(small, mild).continuous(run.samples.take(worst))
    for k, i in enumerate(worst):
        exact = hinf_norm(loops.A[k], loops.B[k][:, :2], loops.C[k], loops.D[k][:, :2]).norm
        assert run.outcomes.sensitivity[i] == pytest.approx(exact, rel=1e-12)
    assert 2 <= len(run.recomputed) <= 4
    assert 0.0 <= run.largest_correction < 1e-2
    assert len(monte_carlo(small, mild, 3, n_exact=0).recomputed) == 0


def test_worst_plants_come_first(run: MonteCarlo) -> None:
    for name in FIGURES:
        values = run.outcomes.figure(name)[run.worst(name, 115)]
        ordered = np.sort(values) if name in ("damping", "least_damping") else -np.sort(-values)
        assert np.array_equal(values, ordered)
    with pytest.raises(DomainError, match="no option 'norm'"):
        run.worst("norm")


def test_an_interrupted_run_goes_on(run: MonteCarlo, small: ControlledPlant, wide: Uncertainty, tmp_path: Path) -> None:
    store = tmp_path / "plants"
    with pytest.raises(KeyboardInterrupt):
        monte_carlo(small, wide, 115, seed=3, store=store, progress=Counting(100))
    rest = Counting()
    same(run, monte_carlo(small, wide, 115, seed=3, store=store, progress=rest))
    assert rest.done == 15
    assert rest.messages == ["100 of 115 plants are there already"]
    nothing = Counting()
    again = monte_carlo(small, wide, 115, seed=3, store=store, progress=nothing)
    assert nothing.done == 0
    assert np.array_equal(again.outcomes.sensitivity, run.outcomes.sensitivity)
    more = Counting()  # the last chunk was not a whole one
    same(run, monte_carlo(small, wide, 145, seed=3, store=store, progress=more))
    assert more.done == 45


def test_damaged_chunks_are_computed_again(
    run: MonteCarlo, small: ControlledPlant, wide: Uncertainty, tmp_path: Path
) -> None:
    monte_carlo(small, wide, 115, seed=3, store=tmp_path)
    (tmp_path / "chunk-00001.npz").write_bytes(b"PK")
    again = Counting()
    same(run, monte_carlo(small, wide, 115, seed=3, store=tmp_path, progress=again))
    assert again.done == 50


def test_a_store_is_that_of_one_run(small: ControlledPlant, wide: Uncertainty, tmp_path: Path) -> None:
    monte_carlo(small, wide, 2, store=tmp_path)
    for subject, uncertainty, seed in (
        (small, wide, 1),
        (small, dataclasses.replace(wide, delay=1.4e-3), 0),
        (dataclasses.replace(small, controller=small.controller.series(_gain(small, 1.001))), wide, 0),
    ):
        with pytest.raises(StorageError, match="holds outcomes of another plant, controller, uncertainty or seed"):
            monte_carlo(subject, uncertainty, 2, seed=seed, store=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be a folder"):
        monte_carlo(small, wide, 2, store=tmp_path / "file")


def _gain(subject: ControlledPlant, factor: float) -> LPVStateSpace:
    return LPVStateSpace.from_system(factor * np.eye(subject.controller.n_y), subject.plant.box)


def test_a_fingerprint_does_not_see_round_off(small: ControlledPlant, wide: Uncertainty) -> None:
    key = fingerprint(small, wide, 0)
    nearly = dataclasses.replace(small, controller=small.controller.series(_gain(small, 1.0 + 1e-13)))
    assert fingerprint(nearly, wide, 0) == key


def test_arguments_are_checked(small: ControlledPlant) -> None:
    for name, value in (("n", 0), ("seed", -1), ("jobs", 0), ("n_exact", 1.5)):
        with pytest.raises(DomainError, match=f"{name} is {value}"):
            monte_carlo(small, **{name: value})  # type: ignore[arg-type]


def test_a_plant_of_local_functions_stays_in_this_process(small: ControlledPlant, wide: Uncertainty) -> None:
    with pytest.raises(DomainError, match=r"the plant cannot be sent to another process.*Use jobs=1"):
        monte_carlo(small, wide, 51, jobs=2)
    assert len(monte_carlo(small, wide, 5, jobs=2)) == 5  # one chunk: nothing is sent


@pytest.mark.slow
def test_jobs_change_nothing(actuator: ControlledPlant, tmp_path: Path) -> None:
    alone = monte_carlo(actuator, n=60, n_exact=1)
    both = Counting()
    same(alone, monte_carlo(actuator, n=60, n_exact=1, jobs=2, store=tmp_path, progress=both))
    assert sorted(path.name for path in tmp_path.glob("*.npz")) == [f"chunk-0000{k}.npz" for k in range(2)]
