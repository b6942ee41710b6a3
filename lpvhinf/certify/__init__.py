"""Certificates: stability and performance proved for every p of a box, round-off included.

Examples
--------
>>> import lpvhinf as lh
>>> G = lh.LPVStateSpace.from_coefficients([[[-2.0]], [[1.0]]], [[1.0]], [[1.0]], [[0.0]], box=[[-1.0, 1.0]])
>>> print(lh.certify.stability(G).claim)
all eigenvalues have real part below 0 1/s at every frozen p, p in [-1, 1]
"""

from lpvhinf.certify.claim import Certificate as Certificate
from lpvhinf.certify.claim import Claim as Claim
from lpvhinf.certify.claim import Refutation as Refutation
from lpvhinf.certify.claim import Undecided as Undecided
from lpvhinf.certify.engine import l2_gain as l2_gain
from lpvhinf.certify.engine import stability as stability
from lpvhinf.certify.global_lyapunov import GlobalLyapunov as GlobalLyapunov
from lpvhinf.certify.global_lyapunov import constant_lyapunov as constant_lyapunov
from lpvhinf.certify.largest import Strongest as Strongest
from lpvhinf.certify.largest import largest_quadratic_box as largest_quadratic_box
from lpvhinf.certify.largest import largest_rate as largest_rate
from lpvhinf.certify.largest import smallest_gain as smallest_gain
