"""The frequency response of some inputs of a loop whose eigenvectors are known already."""

from __future__ import annotations

from lpvhinf.hinfstruct.response import Response
from lpvhinf.robustness.closed_loop import SystemStack


class Channel(Response):
    """`Response` of some inputs of loop k, from the response of all of them; spares a second eigenvalue problem."""

    def __init__(self, whole: Response, loops: SystemStack, k: int, inputs: slice) -> None:
        B, C, D = loops.B[k][:, inputs], loops.C[k], loops.D[k][:, inputs]
        if whole.right is None or whole.left is None:
            super().__init__(loops.A[k], B, C, D)
            return
        self.D = D.astype(complex)
        self.poles, self.abscissa = whole.poles, whole.abscissa
        self.right, self.left = whole.right, whole.left
        self._triangle = None
        self._b, self._c = whole.left @ B, C @ whole.right
