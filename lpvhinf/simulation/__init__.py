"""Set-points, and what they do to plant and loops over time."""

from lpvhinf.simulation.limits import MotionLimits as MotionLimits
from lpvhinf.simulation.moves import chain as chain
from lpvhinf.simulation.moves import hold as hold
from lpvhinf.simulation.moves import point_to_point as point_to_point
from lpvhinf.simulation.scanning import Scan as Scan
from lpvhinf.simulation.scanning import scan as scan
from lpvhinf.simulation.trajectory import Trajectory as Trajectory
from lpvhinf.simulation.trajectory import stay_inside as stay_inside
