"""Goals of structured synthesis besides the norm of the whole loop: channels, bands, poles, H2 norms."""

from lpvhinf.hinfstruct.goals.combined import CombinedOracle as CombinedOracle
from lpvhinf.hinfstruct.goals.constrained import MARGIN as MARGIN
from lpvhinf.hinfstruct.goals.constrained import ConstrainedDescent as ConstrainedDescent
from lpvhinf.hinfstruct.goals.constrained import minimise_constrained as minimise_constrained
from lpvhinf.hinfstruct.goals.constrained import objective_oracle as objective_oracle
from lpvhinf.hinfstruct.goals.descriptions import ChannelNorm as ChannelNorm
from lpvhinf.hinfstruct.goals.descriptions import ClosedLoopPoles as ClosedLoopPoles
from lpvhinf.hinfstruct.goals.descriptions import FrequencyBand as FrequencyBand
from lpvhinf.hinfstruct.goals.descriptions import Goal as Goal
from lpvhinf.hinfstruct.goals.descriptions import H2Norm as H2Norm
from lpvhinf.hinfstruct.goals.goal_oracle import GoalOracle as GoalOracle
from lpvhinf.hinfstruct.goals.state import GoalValue as GoalValue
