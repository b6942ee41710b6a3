"""State spaces over the box P, generalized plants, and their interconnections."""

from lpvhinf.statespace.generalized import GeneralizedPlant as GeneralizedPlant
from lpvhinf.statespace.interop import as_control as as_control
from lpvhinf.statespace.interop import as_scipy as as_scipy
from lpvhinf.statespace.interop import as_transfer_function as as_transfer_function
from lpvhinf.statespace.lpv import LPVFit as LPVFit
from lpvhinf.statespace.lpv import LPVStateSpace as LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant as LPVGeneralizedPlant
from lpvhinf.statespace.mat_file import read_mat as read_mat
from lpvhinf.statespace.mat_file import write_mat as write_mat
