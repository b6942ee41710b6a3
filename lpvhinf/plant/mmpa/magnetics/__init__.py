"""The forces between coils and magnets: the exact field from tables, and its first harmonic."""

from lpvhinf.plant.mmpa.magnetics.coil_wrench import coil_wrench as coil_wrench
from lpvhinf.plant.mmpa.magnetics.first_harmonic import FirstHarmonicField as FirstHarmonicField
from lpvhinf.plant.mmpa.magnetics.separable import SeparableWrench as SeparableWrench
from lpvhinf.plant.mmpa.magnetics.table_cache import cache_folder as cache_folder
from lpvhinf.plant.mmpa.magnetics.tabulated import TabulatedWrench as TabulatedWrench
