"""General-purpose structured H-infinity synthesis, u = + K(theta) y."""

from lpvhinf.hinfstruct.gains import BlockDiagonal as BlockDiagonal
from lpvhinf.hinfstruct.gains import DiagonalGain as DiagonalGain
from lpvhinf.hinfstruct.gains import FixedOrder as FixedOrder
from lpvhinf.hinfstruct.gains import Scaled as Scaled
from lpvhinf.hinfstruct.gains import StaticGain as StaticGain
from lpvhinf.hinfstruct.norm import NormResult as NormResult
from lpvhinf.hinfstruct.norm import hinf_norm as hinf_norm
from lpvhinf.hinfstruct.result import HinfstructResult as HinfstructResult
from lpvhinf.hinfstruct.result import PhaseRecord as PhaseRecord
from lpvhinf.hinfstruct.solve import hinfstruct as hinfstruct
from lpvhinf.hinfstruct.structures import ControllerStructure as ControllerStructure
from lpvhinf.hinfstruct.structures import check_structure as check_structure
