"""State spaces over the box P, generalized plants, and their interconnections."""

from lpvhinf.statespace.generalized import GeneralizedPlant as GeneralizedPlant
from lpvhinf.statespace.lpv import LPVFit as LPVFit
from lpvhinf.statespace.lpv import LPVStateSpace as LPVStateSpace
from lpvhinf.statespace.lpv_generalized import LPVGeneralizedPlant as LPVGeneralizedPlant
