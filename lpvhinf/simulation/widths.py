r"""The fourth-order profile as a step through four moving averages, and their widths from limits.

A step of height d that passes moving averages of x, y, z and w seconds has a piecewise constant fourth derivative. For

.. math:: 0 < x \le y, \quad x + y \le z, \quad x + y + z \le w

its derivatives are pulses of one height each,

.. math::

    \max|\dot r| = \frac{d}{w}, \quad \max|\ddot r| = \frac{d}{zw}, \quad \max|r^{(3)}| = \frac{d}{yzw}, \quad
    \max|r^{(4)}| = \frac{d}{xyzw},

and it lasts x + y + z + w. In the usual words, snap lasts x, jerk is constant for y - x, acceleration for z - x - y and
velocity for w - x - y - z seconds. A change of velocity is the same with three averages x, y, z.

As each peak falls in every width, the shortest profile has the shortest widths that the limits allow, from x upwards;
rounding widths up to whole samples keeps all limits.

Source: [lambrechts2005trajectory]; there, the four durations are found by testing the limits one after another.
"""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array

ROUND_OFF = 1e-12  # relative: a limit that is met to round-off is met
AROUND = 3  # samples to both sides of the best real width within which whole ones are looked for


def velocity_change(amount: float, limits: Array) -> Array:
    """Widths (3,) of the shortest change of velocity by `amount` > 0 under `limits` of acceleration, jerk and snap."""
    acceleration, jerk, snap = (float(limit) for limit in limits)
    x, y = _at_acceleration(acceleration, jerk, snap)
    if amount >= acceleration * (x + y):
        return np.array([x, y, amount / acceleration])
    x = jerk / snap
    if amount >= 2.0 * snap * x**3:
        # V = s x y (x + y), written so that nothing cancels
        c = amount / (snap * x)
        y = 2.0 * c / (x + np.sqrt(x * x + 4.0 * c))
        return np.array([x, y, x + y])
    x = (0.5 * amount / snap) ** (1.0 / 3.0)
    return np.array([x, x, 2.0 * x])


def displacement(amount: float, limits: Array) -> Array:
    """Widths (4,) of the shortest move by `amount` > 0 under `limits` of velocity, acceleration, jerk and snap."""
    velocity, acceleration, jerk, snap = (float(limit) for limit in limits)
    if np.isfinite(velocity):
        ramp = velocity_change(velocity, limits[1:])
        if amount >= velocity * np.sum(ramp):
            return np.append(ramp, amount / velocity)
    # the velocity limit is not reached: w = x + y + z
    x, y = _at_acceleration(acceleration, jerk, snap)
    if np.isfinite(acceleration):
        # d = a z (x + y + z)
        c = amount / acceleration
        z = 2.0 * c / (x + y + np.sqrt((x + y) ** 2 + 4.0 * c))
        if z >= x + y:
            return np.array([x, y, z, x + y + z])
    x = jerk / snap
    if amount >= 8.0 * snap * x**4:
        # z = x + y: d = 2 s x y (x + y)^2, that is u (1 + u)^2 = c with u = y / x
        y = x * _root(0.5 * amount / (snap * x**4))
        return np.array([x, y, x + y, 2.0 * (x + y)])
    x = (amount / (8.0 * snap)) ** 0.25
    return np.array([x, x, 2.0 * x, 4.0 * x])


def whole_samples(widths: Array, amount: float, limits: Array, period: float) -> Array:
    """The shortest widths in whole samples near `widths` that keep the limits, as numbers of samples.

    `limits` are those of the profile, from the lowest derivative upwards, as many as widths.
    """
    smaller = [
        np.arange(max(1, int(np.floor(width / period)) - AROUND), int(np.ceil(width / period)) + AROUND + 1)
        for width in widths[:-1]
    ]
    counts = np.stack([axis.ravel() for axis in np.meshgrid(*smaller, indexing="ij")])
    total = np.cumsum(counts, axis=0)
    counts = counts[:, np.all(counts[1:] >= total[:-1], axis=0)]
    # the largest width is the smallest that keeps every limit: amount / (w ... ) <= limit
    products = np.cumprod(np.vstack([np.ones(counts.shape[1]), period * counts[::-1]]), axis=0)
    needed = np.max(amount / (products * limits[:, None]), axis=0) / period
    largest = np.maximum(np.sum(counts, axis=0), np.ceil(needed * (1.0 - ROUND_OFF)))
    best = int(np.argmin(np.sum(counts, axis=0) + largest))
    return np.append(counts[:, best], largest[best]).astype(int)


def stretched(widths: Array, total: float) -> Array:
    """`widths` made longer in proportion to last `total`; whole numbers stay whole."""
    if np.issubdtype(widths.dtype, np.integer):
        longer = np.floor(widths * (total / np.sum(widths)) * (1.0 + ROUND_OFF)).astype(int)
        longer[-1] = round(total) - np.sum(longer[:-1])
        return longer
    return np.asarray(widths * (total / np.sum(widths)))


def pulses(widths: Array, amount: float) -> tuple[Array, Array]:
    """Durations (m,) of the pieces of a profile, and its highest derivative on each (m,).

    The derivative is a sum of steps of alternating sign at the sums of all subsets of the widths, which the
    inequalities at the head of this module put in binary order.
    """
    n = len(widths)
    index = np.arange(1, 2**n)
    signs = np.cumsum([1.0 - 2.0 * (int(i).bit_count() % 2) for i in index - 1])
    # from one subset to the next its lowest missing width enters and those below it leave; the difference is
    # taken here, as the sums themselves may be large
    entering = [(int(i) & -int(i)).bit_length() - 1 for i in index]
    durations = np.array([widths[k] - np.sum(widths[:k]) for k in entering])
    kept = durations > 0.0
    return durations[kept], (amount / np.prod(widths)) * signs[kept]


def _at_acceleration(acceleration: float, jerk: float, snap: float) -> tuple[float, float]:
    """Widths x and y of the fastest change of acceleration from zero to its limit; infinite without a limit."""
    if not np.isfinite(acceleration):
        return np.inf, np.inf
    x = min(float(np.sqrt(acceleration / snap)), jerk / snap)
    return x, acceleration / (snap * x)


def _root(c: float) -> float:
    """Root u >= 1 of u (1 + u)^2 = c >= 4, by Newton's method from above: the left side is convex."""
    u = c ** (1.0 / 3.0)
    for _ in range(60):
        step = (u * (1.0 + u) ** 2 - c) / ((1.0 + u) * (1.0 + 3.0 * u))
        u -= step
        if abs(step) <= 1e-16 * u:
            break
    return float(u)
