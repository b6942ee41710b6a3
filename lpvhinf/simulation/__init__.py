"""What setpoints, feedforward and disturbances do to the plant and its loops over time."""

from lpvhinf.simulation.excitation import ModeExcitation as ModeExcitation
from lpvhinf.simulation.excitation import WorstExcitation as WorstExcitation
from lpvhinf.simulation.excitation import mode_excitation as mode_excitation
from lpvhinf.simulation.excitation import worst_excitation as worst_excitation
from lpvhinf.simulation.feedforward import RigidBodyFeedforward as RigidBodyFeedforward
from lpvhinf.simulation.setpoint import FourthOrderStep as FourthOrderStep
from lpvhinf.simulation.step_error import StepError as StepError
from lpvhinf.simulation.step_error import step_error as step_error
from lpvhinf.simulation.step_error import step_response as step_response
