"""The paper's generalized plants."""

from lpvhinf.problems.four_block import four_block as four_block
from lpvhinf.problems.loop import Loop as Loop
from lpvhinf.problems.parts import ObserverBranch as ObserverBranch
from lpvhinf.problems.parts import Realized as Realized
from lpvhinf.problems.parts import TunedParts as TunedParts
from lpvhinf.problems.places import PROBLEMS as PROBLEMS
from lpvhinf.problems.places import SIX_BLOCK as SIX_BLOCK
from lpvhinf.problems.places import TWO_BY_TWO as TWO_BY_TWO
from lpvhinf.problems.places import checked_problem as checked_problem
from lpvhinf.problems.places import magnitudes as magnitudes
from lpvhinf.problems.six_block import six_block as six_block
from lpvhinf.problems.two_by_two import two_by_two as two_by_two
from lpvhinf.problems.wiring import Gain as Gain
