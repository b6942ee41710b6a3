"""Dynamic uncertainty: weights that cover a set of plants, and structured synthesis against what they cover."""

from lpvhinf.hinfstruct.uncertainty.channel import UncertainPlant as UncertainPlant
from lpvhinf.hinfstruct.uncertainty.channel import uncertain_plant as uncertain_plant
from lpvhinf.hinfstruct.uncertainty.comparison import Comparison as Comparison
from lpvhinf.hinfstruct.uncertainty.comparison import compare_designs as compare_designs
from lpvhinf.hinfstruct.uncertainty.deviation import deviation as deviation
from lpvhinf.hinfstruct.uncertainty.deviation import resonance_grid as resonance_grid
from lpvhinf.hinfstruct.uncertainty.robust_design import RobustResult as RobustResult
from lpvhinf.hinfstruct.uncertainty.robust_design import hinfstruct_robust as hinfstruct_robust
from lpvhinf.hinfstruct.uncertainty.robust_gain import RobustGain as RobustGain
from lpvhinf.hinfstruct.uncertainty.robust_gain import robust_gain as robust_gain
from lpvhinf.hinfstruct.uncertainty.weight import Coverage as Coverage
from lpvhinf.hinfstruct.uncertainty.weight import UncertaintyWeight as UncertaintyWeight
from lpvhinf.hinfstruct.uncertainty.weight import uncertainty_weight as uncertainty_weight
