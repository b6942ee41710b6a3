"""From a specification to a structured controller over all positions, and what it achieves."""

from lpvhinf.codesign.codesign import codesign as codesign
from lpvhinf.codesign.columns import ColumnNorms as ColumnNorms
from lpvhinf.codesign.columns import column_norms as column_norms
from lpvhinf.codesign.complexity import Complexity as Complexity
from lpvhinf.codesign.complexity import complexity as complexity
from lpvhinf.codesign.design import Design as Design
from lpvhinf.codesign.error_based import feedforward_residual as feedforward_residual
from lpvhinf.codesign.measures import Measures as Measures
from lpvhinf.codesign.measures import largest_real_part as largest_real_part
from lpvhinf.codesign.measures import measure as measure
from lpvhinf.codesign.positions import WorstPosition as WorstPosition
from lpvhinf.codesign.positions import design_positions as design_positions
from lpvhinf.codesign.positions import worst_position as worst_position
from lpvhinf.codesign.specification import Specification as Specification
