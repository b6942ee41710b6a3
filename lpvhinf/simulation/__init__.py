"""What set-points, feedforward and disturbances do to plant and loops over time."""

from lpvhinf.simulation.excitation import ModeExcitation as ModeExcitation
from lpvhinf.simulation.excitation import WorstExcitation as WorstExcitation
from lpvhinf.simulation.excitation import mode_excitation as mode_excitation
from lpvhinf.simulation.excitation import worst_excitation as worst_excitation
from lpvhinf.simulation.feedforward import RigidBodyFeedforward as RigidBodyFeedforward
from lpvhinf.simulation.limits import MotionLimits as MotionLimits
from lpvhinf.simulation.moves import chain as chain
from lpvhinf.simulation.moves import hold as hold
from lpvhinf.simulation.moves import point_to_point as point_to_point
from lpvhinf.simulation.scanning import Scan as Scan
from lpvhinf.simulation.scanning import scan as scan
from lpvhinf.simulation.setpoint import FourthOrderStep as FourthOrderStep
from lpvhinf.simulation.step_error import StepError as StepError
from lpvhinf.simulation.step_error import step_error as step_error
from lpvhinf.simulation.step_error import step_response as step_response
from lpvhinf.simulation.trajectory import Trajectory as Trajectory
from lpvhinf.simulation.trajectory import stay_inside as stay_inside
