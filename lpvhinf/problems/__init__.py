"""The paper's generalized plants."""

from lpvhinf.problems.four_block import four_block as four_block
from lpvhinf.problems.loop import Loop as Loop
from lpvhinf.problems.loop import ObserverBranch as ObserverBranch
from lpvhinf.problems.loop import TunedParts as TunedParts
from lpvhinf.problems.six_block import six_block as six_block
