"""Linear parameter-varying synthesis and analysis by linear matrix inequalities."""

from lpvhinf.lpv.analysis import LPVNormResult as LPVNormResult
from lpvhinf.lpv.analysis import lpvnorm as lpvnorm
from lpvhinf.lpv.controller import FittedController as FittedController
from lpvhinf.lpv.controller import ScheduledController as ScheduledController
from lpvhinf.lpv.discretise import DiscreteController as DiscreteController
from lpvhinf.lpv.discretise import DiscretisationError as DiscretisationError
from lpvhinf.lpv.discretise import discretisation_error as discretisation_error
from lpvhinf.lpv.discretise import discretise as discretise
from lpvhinf.lpv.embedding import AffineEmbedding as AffineEmbedding
from lpvhinf.lpv.embedding import affine_embedding as affine_embedding
from lpvhinf.lpv.polytopic import polytope_weights as polytope_weights
from lpvhinf.lpv.polytopic import with_constant_channels as with_constant_channels
from lpvhinf.lpv.result import LPVSynthesisResult as LPVSynthesisResult
from lpvhinf.lpv.scheduling import monomials as monomials
from lpvhinf.lpv.state_feedback import lpvsyn_statefeedback as lpvsyn_statefeedback
from lpvhinf.lpv.synthesis import lpvsyn as lpvsyn
