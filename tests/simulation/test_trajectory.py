"""Guards set-points: exactly at the limits, never beyond them, from rest to rest, and in the shortest time."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lpvhinf.checks import Array
from lpvhinf.errors import DimensionError, DomainError
from lpvhinf.simulation import MotionLimits, Trajectory, chain, hold, point_to_point, scan, stay_inside
from lpvhinf.simulation.widths import displacement, velocity_change, whole_samples

magnitudes = st.floats(-3.0, 3.0).map(lambda exponent: 10.0**exponent)
maybe_infinite = st.one_of(magnitudes, st.just(np.inf))
quickly = settings(max_examples=60, deadline=None)

# velocity, acceleration, jerk, snap: which of the first three are reached by a move of 1
CASES = {
    "snap": ([np.inf, np.inf, np.inf, 8.0], [0, 0, 0]),
    "jerk": ([np.inf, np.inf, 1.0, 8.0], [0, 0, 1]),
    "acceleration": ([np.inf, 0.5, np.inf, 8.0], [0, 1, 0]),
    "acceleration and jerk": ([np.inf, 0.5, 1.0, 8.0], [0, 1, 1]),
    "velocity": ([0.1, np.inf, np.inf, 8.0], [1, 0, 0]),
    "velocity and jerk": ([0.3, np.inf, 1.0, 8.0], [1, 0, 1]),
    "velocity and acceleration": ([0.4, 0.2, np.inf, 8.0], [1, 1, 0]),
    "all": ([0.4, 0.2, 1.0, 8.0], [1, 1, 1]),
}


def limits_of(values: list[float]) -> MotionLimits:
    return MotionLimits(velocity=values[0], acceleration=values[1], jerk=values[2], snap=values[3])


@pytest.mark.parametrize("case", CASES, ids=str)
def test_every_limit_case_is_exactly_at_its_limits(case: str) -> None:
    values, reached = CASES[case]
    move = point_to_point(0.0, 1.0, limits_of(values))
    ratio = move.peaks[:, 0] / values
    assert ratio[3] == pytest.approx(1.0, rel=1e-12)
    for limit, wanted in zip(ratio[:3], reached, strict=True):
        assert limit == pytest.approx(1.0, rel=1e-12) if wanted else limit < 1.0 - 1e-6


@quickly
@given(distance=magnitudes, v=maybe_infinite, a=maybe_infinite, j=maybe_infinite, s=magnitudes)
def test_a_move_keeps_its_limits_and_ends_at_rest_where_it_should(
    distance: float, v: float, a: float, j: float, s: float
) -> None:
    move = point_to_point(0.0, distance, limits_of([v, a, j, s]))
    ratio = move.peaks[:, 0] / [v, a, j, s]
    assert np.all(ratio <= 1.0 + 1e-12)
    assert np.max(ratio) >= 1.0 - 1e-12
    # just before the end, the pieces arrive by themselves
    T = move.duration
    arriving = move.evaluate([np.nextafter(T, 0.0)])[:, 0, 0]
    assert arriving[0] == pytest.approx(distance, rel=1e-10)
    scale = np.array([distance / T, distance / T**2, distance / T**3])
    # a time is known to its last digit only, in which the next derivative acts
    late = 8.0 * np.spacing(T) * move.peaks[1:4, 0]
    assert np.all(np.abs(arriving[1:4]) <= 1e-9 * scale * np.maximum(1.0, move.peaks[:3, 0] / scale) + late)


@quickly
@given(distance=magnitudes, v=maybe_infinite, a=maybe_infinite, j=maybe_infinite, s=magnitudes)
def test_no_profile_of_its_kind_is_shorter(distance: float, v: float, a: float, j: float, s: float) -> None:
    limits = np.array([v, a, j, s])
    widths = displacement(distance, limits)
    rng = np.random.default_rng(0)
    x, y, z = widths[:3, None] * np.exp(0.3 * rng.standard_normal((3, 4000)) * rng.random(4000) ** 3)
    y = np.maximum(x, y)
    z = np.maximum(x + y, z)
    w = np.max(
        [distance / v * np.ones_like(x), distance / (a * z), distance / (j * y * z), distance / (s * x * y * z)], axis=0
    )
    total = x + y + z + np.maximum(w, x + y + z)
    assert np.min(total) >= np.sum(widths) * (1.0 - 1e-12)
    assert np.min(total) <= np.sum(widths) * 1.05  # the search does come near


@quickly
@given(amount=magnitudes, a=maybe_infinite, j=maybe_infinite, s=magnitudes)
def test_no_change_of_velocity_is_shorter(amount: float, a: float, j: float, s: float) -> None:
    x, y, z = velocity_change(amount, np.array([a, j, s]))
    assert x <= y * (1 + 1e-12)
    assert x + y <= z * (1 + 1e-12)
    assert max(amount / (a * z), amount / (j * y * z), amount / (s * x * y * z)) == pytest.approx(1.0, rel=1e-12)
    rng = np.random.default_rng(1)
    xs, ys = np.array([[x], [y]]) * np.exp(0.3 * rng.standard_normal((2, 4000)) * rng.random(4000) ** 3)
    ys = np.maximum(xs, ys)
    zs = np.max([xs + ys, amount / a * np.ones_like(xs), amount / (j * ys), amount / (s * xs * ys)], axis=0)
    assert np.min(xs + ys + zs) >= (x + y + z) * (1.0 - 1e-12)


def shortest_by_enumeration(limits: Array, most: int) -> int:
    """Samples of the shortest move by 1 with a period of 1, over all whole widths."""
    v, a, j, s = limits
    best = most
    for x, y in itertools.product(range(1, most // 8 + 2), range(1, most // 4 + 2)):
        for z in range(x + y, most // 2 + 2) if y >= x else ():
            w = max(1 / v, 1 / (a * z), 1 / (j * y * z), 1 / (s * x * y * z))
            best = min(best, x + y + z + max(x + y + z, int(np.ceil(w * (1 - 1e-12)))))
    return best


@settings(max_examples=30, deadline=None)
@given(st.floats(-1.5, -0.2), st.floats(-2.5, -0.5), st.floats(-3.0, -1.0), st.floats(-4.0, -1.0))
def test_whole_samples_are_the_shortest_ones(v: float, a: float, j: float, s: float) -> None:
    limits = 10.0 ** np.array([v, a, j, s])
    real = displacement(1.0, limits)
    assume(np.sum(real) < 60)
    found = whole_samples(real, 1.0, limits, 1.0)
    assert int(np.sum(found)) == shortest_by_enumeration(limits, int(np.sum(found)) + 1)


@quickly
@given(
    distance=magnitudes, v=maybe_infinite, a=maybe_infinite, j=maybe_infinite, s=magnitudes, samples=st.floats(1.0, 1e4)
)
def test_whole_samples_keep_the_limits_and_cost_a_few(
    distance: float, v: float, a: float, j: float, s: float, samples: float
) -> None:
    limits = limits_of([v, a, j, s])
    ideal = point_to_point(0.0, distance, limits)
    period = ideal.duration / samples
    move = point_to_point(0.0, distance, limits, period=period)
    counts = move.knots / period
    assert np.allclose(counts, np.round(counts), atol=1e-6)
    move.check(limits=limits)
    assert np.all(move.peaks[:, 0] <= np.array([v, a, j, s]) * (1.0 + 1e-11))
    assert ideal.duration * (1 - 1e-11) <= move.duration <= ideal.duration + 9.0 * period
    assert move.position(np.nextafter(move.duration, 0.0))[0] == pytest.approx(distance, rel=1e-9)


def test_where_snap_alone_limits_the_time_optimum_is_as_much_shorter_as_is_said() -> None:
    # bang-bang snap with switches at (1 - cos(k pi / 4)) / 2: the polynomial U_3 is of least L1 norm
    s, T = 2.0, 1.3
    knots = T * 0.5 * (1.0 - np.cos(np.pi * np.arange(5) / 4))
    state = np.zeros(4)
    for time, snap in zip(np.diff(knots), s * np.array([1.0, -1.0, 1.0, -1.0]), strict=True):
        state = np.array(
            [
                sum(np.append(state, snap)[k:][i] * time**i / np.prod(np.arange(1, i + 1)) for i in range(5 - k))
                for k in range(4)
            ]
        )
    assert np.allclose(state[1:], 0.0, atol=1e-14)
    ours = point_to_point(0.0, state[0], MotionLimits(snap=s))
    assert ours.duration / T == pytest.approx((64.0 / 3.0) ** 0.25 / 2.0, rel=1e-12)


def test_derivatives_agree_with_differences() -> None:
    move = point_to_point([0.0, 1.0], [0.1, 0.8], MotionLimits(velocity=0.5, acceleration=10.0, jerk=500.0, snap=1e5))
    t = np.linspace(-0.01, move.duration + 0.01, 200_001)
    values = move.evaluate(t)
    assert values.shape == (5, len(t), 2)
    for order in range(4):
        slope = np.diff(values[order], axis=0) / np.diff(t)[:, None]
        middle = 0.5 * (values[order + 1][1:] + values[order + 1][:-1])
        if order < 3:  # the snap jumps
            assert np.max(np.abs(slope - middle)) <= 1e-3 * np.max(np.abs(middle))
    assert np.array_equal(move.position(t), values[0])
    assert np.array_equal(move.position(0.02), move.position([0.02])[0])
    assert np.all(values[0][t < 0] == [0.0, 1.0])
    assert np.all(values[0][t >= move.duration] == [0.1, 0.8])


def test_six_axes_move_on_a_line_within_the_limits_of_each() -> None:
    limits = MotionLimits(
        velocity=[0.5, 0.5, 0.02, 0.1, 0.1, 0.1],
        acceleration=[12.0, 12.0, 1.0, 10.0, 10.0, 10.0],
        jerk=[1e3, 1e3, 1e2, 1e3, 1e3, 1e3],
        snap=[2e5, 2e5, 2e4, 1e5, 1e5, 1e5],
    )
    start, end = np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0]), np.array([0.05, -0.03, 1e-3, 1e-4, 0.0, -2e-4])
    move = point_to_point(start, end, limits, box=[[-0.06, 0.06], [-0.06, 0.06]])
    ratio = move.peaks / limits.array(6)
    assert np.max(ratio) == pytest.approx(1.0, rel=1e-12)
    assert np.max(ratio[:, 4]) == 0.0
    share = (move.position(move.times(1e-3)) - start)[:, [0, 1, 2, 3, 5]] / (end - start)[[0, 1, 2, 3, 5]]
    assert np.allclose(share, share[:, :1], atol=1e-12)


def test_a_chain_is_its_parts() -> None:
    limits = MotionLimits(acceleration=5.0, snap=1e5)
    there, back = point_to_point(0.0, 0.1, limits), point_to_point(0.1, -0.2, limits)
    whole = chain([there, hold(0.1, 0.2), back])
    t = np.linspace(0.0, back.duration, 300)
    assert np.allclose(whole.position(t + there.duration + 0.2), back.position(t), atol=1e-12)
    assert np.all(whole.position(np.linspace(there.duration, there.duration + 0.2, 9)) == 0.1)
    with pytest.raises(DomainError, match="begins at"):
        chain([there, there])
    with pytest.raises(DimensionError, match="axes"):
        chain([there, hold([0.1, 0.2], 1.0)])
    with pytest.raises(DomainError, match="empty"):
        chain([])


SCAN_LIMITS = MotionLimits(velocity=1.0, acceleration=20.0, jerk=4000.0, snap=2e6)


@pytest.mark.parametrize("period", [None, 1e-4])
@pytest.mark.parametrize(("lines", "step"), [(1, None), (3, [0.02, 0.0, 1e-4]), (4, [1e-4, 0.0, 0.0]), (2, None)])
def test_a_scan_has_constant_velocity_in_its_windows_and_rests_elsewhere(
    period: float | None, lines: int, step: list[float] | None
) -> None:
    made = scan(
        [0.0, -0.01, 0.0], axis=1, length=0.0301, velocity=0.3, limits=SCAN_LIMITS, lines=lines, step=step,
        settle_time=0.0052, period=period,
    )  # fmt: skip
    move, shift = made.trajectory, np.zeros(3) if step is None else np.array(step)
    assert made.windows.shape == (lines, 2)
    for i, (begin, end) in enumerate(made.windows):
        t = np.linspace(begin - 0.0052, end, 50)
        values = move.evaluate(t)
        speed = 0.3 if i % 2 == 0 else -0.3
        assert np.allclose(values[1], [0.0, speed, 0.0], atol=1e-11)
        assert np.allclose(values[2:4, :, 1], 0.0, atol=1e-9)
        assert np.allclose(values[0][:, [0, 2]], (i * shift)[[0, 2]], atol=1e-12)
        length = abs(move.position(end)[1] - move.position(begin)[1])
        assert -1e-12 <= length - 0.0301 <= (0.0 if period is None else 0.3 * period) + 1e-12
        low = move.position(begin if speed > 0 else end)[1]
        assert low == pytest.approx(-0.01, abs=1e-12)
    move.check(limits=SCAN_LIMITS)
    assert np.max(move.peaks[:, 1] / SCAN_LIMITS.array(1)[:, 0]) > (0.97 if period else 1 - 1e-9)
    continuous(move)
    if period is not None:
        assert np.allclose(move.knots / period, np.round(move.knots / period), atol=1e-6)


def continuous(move: Trajectory) -> None:
    before = move.evaluate(np.nextafter(move.knots[1:], 0.0))
    after = move.evaluate(move.knots[1:])
    for order in range(4):
        scale = max(1.0, float(np.max(move.peaks[order - 1]))) if order else 1.0
        assert np.max(np.abs(before[order] - after[order])) <= 1e-9 * scale


def test_scanning_downwards_mirrors_scanning_upwards() -> None:
    up = scan(0.0, axis=0, length=0.03, velocity=0.3, limits=SCAN_LIMITS, lines=2).trajectory
    down = scan(0.0, axis=0, length=-0.03, velocity=0.3, limits=SCAN_LIMITS, lines=2).trajectory
    t = up.times(1e-3)
    assert np.allclose(up.position(t), -down.position(t), atol=1e-15)


def test_leaving_P_is_reported_with_the_first_time() -> None:
    limits = MotionLimits(velocity=0.5, acceleration=10.0, snap=1e5)
    move = point_to_point([0.0, 0.0], [0.1, 0.0], limits)
    with pytest.raises(DomainError, match=r"leaves P at t = .* s: axis 0 passes 0\.06") as caught:
        move.check(box=[[-0.06, 0.06], [-0.06, 0.06]])
    time = float(str(caught.value).split("t = ")[1].split(" s")[0])
    assert move.position(time)[0] == pytest.approx(0.06, abs=1e-6)
    with pytest.raises(DomainError, match="leaves P"):
        point_to_point([0.0], [0.1], limits, box=[[-0.06, 0.06]])
    with pytest.raises(DomainError, match="leaves P"):  # its run-up does
        scan([0.0], axis=0, length=0.05, velocity=0.3, limits=SCAN_LIMITS, box=[[0.0, 0.06]])
    t = move.times(1e-4)
    with pytest.raises(DomainError, match="leaves P at t = ") as sampled:
        stay_inside(t, move.position(t), [[-0.06, 0.06], [-0.06, 0.06]])
    later = float(str(sampled.value).split("t = ")[1].split(" s")[0])
    assert time - 1e-6 <= later <= time + 1.1e-4
    stay_inside(t, move.position(t), [[-0.06, 0.1], [-0.06, 0.06]])


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_exceeding_a_limit_is_reported_with_the_first_time(order: int) -> None:
    values = [0.5, 10.0, 800.0, 1e5]
    move = point_to_point(0.0, 0.2, limits_of(values))
    move.check(limits=limits_of(values))
    lower = list(values)
    lower[order - 1] *= 0.7
    name = ("velocity", "acceleration", "jerk", "snap")[order - 1]
    with pytest.raises(DomainError, match=f"exceeds a limit at t = .* s: {name} of axis 0") as caught:
        move.check(limits=limits_of(lower))
    time = float(str(caught.value).split("t = ")[1].split(" s")[0])
    value = abs(move.derivative(time, order)[0])
    assert value == pytest.approx(lower[order - 1], rel=1e-4) if order < 4 else time == 0.0


def test_bad_input_is_named() -> None:
    good = MotionLimits(snap=1.0)
    with pytest.raises(DomainError, match="snap is"):
        MotionLimits(snap=np.inf)
    with pytest.raises(DomainError, match="above 0"):
        MotionLimits(snap=1.0, jerk=np.nan)
    with pytest.raises(DimensionError, match="entries"):
        MotionLimits(snap=[1.0, 2.0], jerk=[1.0, 2.0, 3.0])
    with pytest.raises(DimensionError, match="limits are for 2 axes"):
        point_to_point([0.0] * 3, [1.0] * 3, MotionLimits(snap=[1.0, 2.0]))
    with pytest.raises(DomainError, match="hold"):
        point_to_point(1.0, 1.0, good)
    with pytest.raises(DimensionError, match="wanted"):
        point_to_point([1.0, 2.0], 1.0, good)
    with pytest.raises(DomainError, match="period"):
        point_to_point(0.0, 1.0, good, period=0.0)
    with pytest.raises(DomainError, match="Scan slower"):
        scan(0.0, axis=0, length=1.0, velocity=2.0, limits=SCAN_LIMITS)
    with pytest.raises(DomainError, match="side by side"):
        scan([0.0, 0.0], axis=0, length=1.0, velocity=0.2, limits=SCAN_LIMITS, lines=2, step=[1.0, 0.0])
    with pytest.raises(DomainError, match="axis is 3"):
        scan([0.0, 0.0], axis=3, length=1.0, velocity=0.2, limits=SCAN_LIMITS)
    with pytest.raises(DomainError, match="settle_time"):
        scan(0.0, axis=0, length=1.0, velocity=0.2, limits=SCAN_LIMITS, settle_time=-1.0)
    with pytest.raises(DomainError, match="knots do not increase"):
        Trajectory(knots=[0.0, -1.0], states=np.zeros((1, 5, 1)), end=[0.0])


def test_tables_for_notebooks() -> None:
    made = scan([0.0, 0.0], axis=1, length=0.01, velocity=0.3, limits=SCAN_LIMITS)
    assert "<th>largest snap</th>" in made.trajectory._repr_html_()
    assert "<td>0.3</td>" in made.trajectory._repr_html_()
    assert "0.3 m/s" in made._repr_html_()
