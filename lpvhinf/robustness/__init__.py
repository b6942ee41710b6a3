"""How a controller fares with plants that are not quite what it was made for: sampling, and search for the worst."""

from lpvhinf.robustness.controlled_plant import ControlledPlant as ControlledPlant
from lpvhinf.robustness.monte_carlo import MonteCarlo as MonteCarlo
from lpvhinf.robustness.monte_carlo import monte_carlo as monte_carlo
from lpvhinf.robustness.outcomes import Analysis as Analysis
from lpvhinf.robustness.outcomes import Outcomes as Outcomes
from lpvhinf.robustness.report import robustness_report as robustness_report
from lpvhinf.robustness.report import share_bounds as share_bounds
from lpvhinf.robustness.samples import Samples as Samples
from lpvhinf.robustness.uncertainty import Uncertainty as Uncertainty
from lpvhinf.robustness.worst_case import WorstCase as WorstCase
from lpvhinf.robustness.worst_case import worst_case as worst_case
