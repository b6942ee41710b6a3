"""Structured H-infinity and LPV design for motion systems whose flexible modes change with position.

Examples
--------
>>> import lpvhinf as lh
>>> plant = lh.mmpa.benchmark(magnetics="first-harmonic")  # leave it out for the exact field of all magnets
>>> lh.decouple(plant, n_flex=1).n_modes
21
"""

# Rooms whose function has the room's own name come first: importing the room binds the name to the module, the line
# that follows binds it to the function, and nothing imports the room for the first time after that.
from lpvhinf.codesign import codesign as codesign  # noqa: I001
from lpvhinf.hinfstruct import hinfstruct as hinfstruct

from lpvhinf import certify as certify
from lpvhinf.codesign import Design as Design
from lpvhinf.codesign import Specification as Specification
from lpvhinf.decoupling import DecoupledPlant as DecoupledPlant
from lpvhinf.decoupling import decouple as decouple
from lpvhinf.errors import AssumptionError as AssumptionError
from lpvhinf.errors import DimensionError as DimensionError
from lpvhinf.errors import DomainError as DomainError
from lpvhinf.errors import LpvHinfError as LpvHinfError
from lpvhinf.errors import LpvHinfWarning as LpvHinfWarning
from lpvhinf.errors import StorageError as StorageError
from lpvhinf.errors import SynthesisError as SynthesisError
from lpvhinf.hinfstruct import BlockDiagonal as BlockDiagonal
from lpvhinf.hinfstruct import ChannelNorm as ChannelNorm
from lpvhinf.hinfstruct import ClosedLoopPoles as ClosedLoopPoles
from lpvhinf.hinfstruct import ControllerStructure as ControllerStructure
from lpvhinf.hinfstruct import DiagonalGain as DiagonalGain
from lpvhinf.hinfstruct import FixedOrder as FixedOrder
from lpvhinf.hinfstruct import FrequencyBand as FrequencyBand
from lpvhinf.hinfstruct import H2Norm as H2Norm
from lpvhinf.hinfstruct import HinfstructResult as HinfstructResult
from lpvhinf.hinfstruct import Lead as Lead
from lpvhinf.hinfstruct import LowPass as LowPass
from lpvhinf.hinfstruct import Notch as Notch
from lpvhinf.hinfstruct import PID as PID
from lpvhinf.hinfstruct import Scheduled as Scheduled
from lpvhinf.hinfstruct import Series as Series
from lpvhinf.hinfstruct import SmoothMap as SmoothMap
from lpvhinf.hinfstruct import StaticGain as StaticGain
from lpvhinf.hinfstruct import Sum as Sum
from lpvhinf.hinfstruct import hinf_norm as hinf_norm
from lpvhinf.hinfstruct import lower_bound as lower_bound
from lpvhinf.lpv import AffineEmbedding as AffineEmbedding
from lpvhinf.lpv import DiscreteController as DiscreteController
from lpvhinf.lpv import LPVNormResult as LPVNormResult
from lpvhinf.lpv import LPVSynthesisResult as LPVSynthesisResult
from lpvhinf.lpv import ScheduledController as ScheduledController
from lpvhinf.lpv import affine_embedding as affine_embedding
from lpvhinf.lpv import discretise as discretise
from lpvhinf.lpv import lpvnorm as lpvnorm
from lpvhinf.lpv import lpvsyn as lpvsyn
from lpvhinf.lpv import lpvsyn_statefeedback as lpvsyn_statefeedback
from lpvhinf.plant import Actuator as Actuator
from lpvhinf.plant import MechanicalModel as MechanicalModel
from lpvhinf.plant import ModalModel as ModalModel
from lpvhinf.plant import ModeData as ModeData
from lpvhinf.plant import Plausibility as Plausibility
from lpvhinf.plant import RigidBody as RigidBody
from lpvhinf.plant import Sensor as Sensor
from lpvhinf.plant import mmpa as mmpa
from lpvhinf.plant import modal_form as modal_form
from lpvhinf.plant import own_plant as own_plant
from lpvhinf.progress import Progress as Progress
from lpvhinf.statespace import GeneralizedPlant as GeneralizedPlant
from lpvhinf.statespace import LPVGeneralizedPlant as LPVGeneralizedPlant
from lpvhinf.statespace import LPVStateSpace as LPVStateSpace
from lpvhinf.export import SampledController as SampledController
from lpvhinf.export import sampled as sampled
from lpvhinf.simulation import MotionLimits as MotionLimits
from lpvhinf.simulation import RigidBodyFeedforward as RigidBodyFeedforward
from lpvhinf.simulation import Trajectory as Trajectory
from lpvhinf.simulation import point_to_point as point_to_point
from lpvhinf.simulation import scan as scan
from lpvhinf.robustness import Uncertainty as Uncertainty
from lpvhinf.robustness import monte_carlo as monte_carlo
from lpvhinf.robustness import worst_case as worst_case

__version__ = "0.1.0"
