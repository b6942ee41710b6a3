"""Lead, low-pass and notch filters in physical parameters, one on every channel."""

from __future__ import annotations

import numpy as np

from lpvhinf.checks import Array
from lpvhinf.hinfstruct.sections import Bounds, FirstOrderSections, SecondOrderSections

TWO_PI = 2.0 * np.pi


class Lead(FirstOrderSections):
    r"""A lead filter with gain one at low frequencies.

    .. math:: H(s) = \frac{1 + s/\omega_z}{1 + s/\omega_p}, \quad
              \omega_z = 2\pi f / \sqrt r, \quad \omega_p = 2\pi f \sqrt r

    Its phase is largest, :math:`\arcsin \frac{r - 1}{r + 1}`, at f. With r < 1 allowed it is a lag filter as well.

    Parameters
    ----------
    n : int
        Channels.
    f : (low, high) [Hz], optional
        Bounds of the frequency f.
    ratio : (low, high), optional
        Bounds of r; 1 and 100 if left out.

    Raises
    ------
    DomainError
        If bounds are not 0 <= low < high.

    Examples
    --------
    >>> lead = Lead(1, f=(1.0, 100.0))
    >>> A, B, C, D = lead.realize(lead.parameters(f=10.0, ratio=9.0))
    >>> H = (C @ np.linalg.inv(2j * np.pi * 10.0 * np.eye(1) - A) @ B + D)[0, 0]
    >>> float(np.degrees(np.angle(H))), float(abs(H))
    (53.13, 3.0)
    """

    def __init__(self, n: int = 1, *, f: Bounds = None, ratio: Bounds = (1.0, 100.0)) -> None:
        super().__init__(n, {"f": f, "ratio": ratio})

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array]:
        r = values["ratio"]
        return TWO_PI * values["f"] * np.sqrt(r), np.ones_like(r), r

    def _back(self, values: dict[str, Array], omega: Array, b0: Array, d: Array) -> dict[str, Array]:
        f, r = values["f"], values["ratio"]
        return {"f": TWO_PI * np.sqrt(r) * omega, "ratio": d + 0.5 * TWO_PI * f / np.sqrt(r) * omega}


class FirstOrderLowPass(FirstOrderSections):
    r"""A first-order low-pass, :math:`H(s) = 1 / (1 + s / 2\pi f)`.

    Parameters
    ----------
    n : int
        Channels.
    f : (low, high) [Hz], optional
        Bounds of the cut-off frequency.

    Raises
    ------
    DomainError
        If bounds are not 0 <= low < high.

    Examples
    --------
    >>> low_pass = FirstOrderLowPass(2, f=(1.0, 100.0))
    >>> low_pass.physical(low_pass.parameters(f=[5.0, 20.0]))["f"]
    array([ 5., 20.])
    """

    def __init__(self, n: int = 1, *, f: Bounds = None) -> None:
        super().__init__(n, {"f": f})

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array]:
        f = values["f"]
        return TWO_PI * f, np.ones_like(f), np.zeros_like(f)

    def _back(self, values: dict[str, Array], omega: Array, b0: Array, d: Array) -> dict[str, Array]:
        return {"f": TWO_PI * omega}


class LowPass(SecondOrderSections):
    r"""A second-order low-pass.

    .. math:: H(s) = \frac{1}{s^2/\omega^2 + 2 \zeta s/\omega + 1}, \quad \omega = 2\pi f

    Parameters
    ----------
    n : int
        Channels.
    f : (low, high) [Hz], optional
        Bounds of the cut-off frequency.
    zeta : (low, high), optional
        Bounds of the damping ratio; 0.3 and 2 if left out.

    Raises
    ------
    DomainError
        If bounds are not 0 <= low < high.

    Examples
    --------
    >>> LowPass(3, f=(100.0, 1000.0)).n_x
    6
    """

    def __init__(self, n: int = 1, *, f: Bounds = None, zeta: Bounds = (0.3, 2.0)) -> None:
        super().__init__(n, {"f": f, "zeta": zeta})

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
        zero = np.zeros_like(values["f"])
        return TWO_PI * values["f"], 2.0 * values["zeta"], zero + 1.0, zero, zero

    def _back(self, values: dict[str, Array], g: tuple[Array, Array, Array, Array, Array]) -> dict[str, Array]:
        return {"f": TWO_PI * g[0], "zeta": 2.0 * g[1]}


class Notch(SecondOrderSections):
    r"""A notch filter with gain one at low and at high frequencies, and gain `depth` at f.

    .. math:: H(s) = \frac{s^2/\omega^2 + 2 \eta \zeta s/\omega + 1}{s^2/\omega^2 + 2 \zeta s/\omega + 1},
              \quad \omega = 2\pi f

    Parameters
    ----------
    n : int
        Channels.
    f : (low, high) [Hz], optional
        Bounds of the notch frequency.
    zeta : (low, high), optional
        Bounds of the damping ratio of the poles, half the relative width; 0.05 and 2 if left out.
    depth : (low, high), optional
        Bounds of the gain at f; 0.001 and 1 if left out.

    Raises
    ------
    DomainError
        If bounds are not 0 <= low < high.

    Examples
    --------
    >>> notch = Notch(1, f=(100.0, 200.0))
    >>> A, B, C, D = notch.realize(notch.parameters(f=140.0, zeta=0.3, depth=0.1))
    >>> float(abs(C @ np.linalg.inv(2j * np.pi * 140.0 * np.eye(2) - A) @ B + D)[0, 0])
    0.1
    """

    def __init__(
        self, n: int = 1, *, f: Bounds = None, zeta: Bounds = (0.05, 2.0), depth: Bounds = (0.001, 1.0)
    ) -> None:
        super().__init__(n, {"f": f, "zeta": zeta, "depth": depth})

    def _coefficients(self, values: dict[str, Array]) -> tuple[Array, Array, Array, Array, Array]:
        one, a1 = np.ones_like(values["f"]), 2.0 * values["zeta"]
        return TWO_PI * values["f"], a1, one, a1 * values["depth"], one

    def _back(self, values: dict[str, Array], g: tuple[Array, Array, Array, Array, Array]) -> dict[str, Array]:
        zeta, depth = values["zeta"], values["depth"]
        return {"f": TWO_PI * g[0], "zeta": 2.0 * g[1] + 2.0 * depth * g[3], "depth": 2.0 * zeta * g[3]}
