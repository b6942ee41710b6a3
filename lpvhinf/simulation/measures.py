r"""What a motion is judged by: moving average and moving standard deviation of the error, settling, effort.

For an error e(t) and a window of length :math:`T_w`, over which a scanner exposes one point,

.. math:: MA(t) = \frac{1}{T_w}\int_{t - T_w/2}^{t + T_w/2} e\, d\tau, \qquad
          MSD(t) = \sqrt{\frac{1}{T_w}\int_{t - T_w/2}^{t + T_w/2} (e - MA(t))^2\, d\tau}

[butler2011position]: MA is overlay, MSD is blur. Their largest values over all windows within the lines count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpvhinf.checks import Array, finite_array, positive, read_only
from lpvhinf.errors import DimensionError, DomainError


@dataclass(frozen=True, kw_only=True, eq=False)
class WindowErrors:
    """Largest values over the lines of a scan, each (n,) [m, rad].

    Attributes
    ----------
    moving_average, moving_deviation
        Largest absolute MA, largest MSD.
    peak, rms
        Largest absolute error and root mean square of the error in the lines.
    """

    moving_average: Array
    moving_deviation: Array
    peak: Array
    rms: Array


def moving_statistics(error: ArrayLike, width: int) -> tuple[Array, Array]:
    """MA and MSD of errors (N, n) over all windows of `width` samples, each (N - width + 1, n).

    Raises
    ------
    DomainError
        If the width is not a whole number from 1 to N.

    Examples
    --------
    >>> average, deviation = moving_statistics([[1.0], [3.0], [3.0]], 2)
    >>> average.ravel().tolist(), deviation.ravel().tolist()
    ([2.0, 3.0], [1.0, 0.0])
    """
    e = finite_array("error", error, (None, None))
    if isinstance(width, bool) or not isinstance(width, int | np.integer) or not 1 <= width <= len(e):
        raise DomainError(f"width is {width!r}, wanted a whole number of samples from 1 to {len(e)}.")
    # two passes, as sums of squares of an offset would lose the digits of what varies about it
    windows = np.lib.stride_tricks.sliding_window_view(e, int(width), axis=0)
    average = np.mean(windows, axis=-1)
    return average, np.sqrt(np.mean((windows - average[..., None]) ** 2, axis=-1))


def window_errors(times: ArrayLike, error: ArrayLike, windows: ArrayLike, width: float) -> WindowErrors:
    """MA, MSD, peak and root mean square of an error within the lines of a scan.

    Parameters
    ----------
    times : (N,) [s]
        At one period.
    error : (N, n)
    windows : (lines, 2) [s]
        Begin and end of every line; `Scan.windows`.
    width : float
        T_w [s], rounded to whole samples; at most the shortest line.

    Raises
    ------
    DomainError
        If a line is not within the times, or shorter than `width`.

    Examples
    --------
    >>> t = 1e-3 * np.arange(1000)
    >>> found = window_errors(t, np.sin(2 * np.pi * 100 * t)[:, None], [[0.1, 0.9]], 0.1)
    >>> found.moving_average.round(9).tolist(), found.moving_deviation.round(6).tolist()
    ([0.0], [0.707107])
    """
    t, e = finite_array("times", times, (None,)), finite_array("error", error, (None, None))
    lines = finite_array("windows", windows, (None, 2))
    if len(t) != len(e) or len(t) < 2:
        raise DimensionError(f"times has {len(t)} samples and error {len(e)}, wanted the same number of at least 2.")
    period = (t[-1] - t[0]) / (len(t) - 1)
    samples = max(1, round(positive("width", width, "s") / period))
    averages, deviations, inside = [], [], []
    for begin, end in lines:
        if begin < t[0] - 0.5 * period or end > t[-1] + 0.5 * period:
            raise DomainError(
                f"windows has the line {begin:.6g} to {end:.6g} s, wanted within {t[0]:.6g} to {t[-1]:.6g} s. Was the "
                "motion stopped?"
            )
        part = e[(t > begin - 1e-6 * period) & (t < end + 1e-6 * period)]
        if len(part) < samples:
            raise DomainError(f"width is {width} s, wanted at most the line of {end - begin:.6g} s.")
        average, deviation = moving_statistics(part, samples)
        averages.append(np.max(np.abs(average), axis=0))
        deviations.append(np.max(deviation, axis=0))
        inside.append(part)
    whole = np.concatenate(inside)
    return WindowErrors(
        moving_average=read_only(np.max(averages, axis=0)),
        moving_deviation=read_only(np.max(deviations, axis=0)),
        peak=read_only(np.max(np.abs(whole), axis=0)),
        rms=read_only(np.sqrt(np.mean(whole**2, axis=0))),
    )


def settling_time(times: ArrayLike, error: ArrayLike, tolerance: ArrayLike, *, after: float) -> Array:
    """Time from `after` until an error stays within its tolerance for good, (n,) [s]; infinite if it never does.

    Parameters
    ----------
    times : (N,) [s]
    error : (N, n)
    tolerance : float or (n,)
    after : float
        End of the set-point, or begin of a line [s].

    Examples
    --------
    >>> settling_time([0.0, 0.1, 0.2, 0.3], [[1.0], [5.0], [0.5], [0.2]], 1.0, after=0.1).round(6).tolist()
    [0.1]
    """
    t, e = finite_array("times", times, (None,)), finite_array("error", error, (None, None))
    allowed = np.broadcast_to(finite_array("tolerance", tolerance), (e.shape[1],))
    if np.any(allowed <= 0.0):
        raise DomainError(f"tolerance is {allowed.tolist()}, wanted numbers above 0.")
    if len(t) != len(e) or not np.any(t >= after):
        raise DomainError(f"after is {after} s, wanted a time within the {len(t)} samples of an error of {len(e)}.")
    out = np.empty(e.shape[1])
    for axis, limit in enumerate(allowed):
        beyond = np.flatnonzero((np.abs(e[:, axis]) > limit) & (t >= after))
        if not len(beyond):
            out[axis] = 0.0
        else:
            out[axis] = t[beyond[-1] + 1] - after if beyond[-1] + 1 < len(t) else np.inf
    return out


def rms_and_peak(signal: ArrayLike) -> tuple[Array, Array]:
    """Root mean square and largest absolute value of signals (N, n), each (n,).

    Examples
    --------
    >>> [x.tolist() for x in rms_and_peak([[3.0], [-3.0]])]
    [[3.0], [3.0]]
    """
    u = finite_array("signal", signal, (None, None))
    return np.sqrt(np.mean(u**2, axis=0)), np.max(np.abs(u), axis=0)
