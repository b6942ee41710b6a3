"""An open moving-magnet planar actuator benchmark."""

from lpvhinf.plant.mmpa.benchmark import MMPA as MMPA
from lpvhinf.plant.mmpa.benchmark import benchmark as benchmark
from lpvhinf.plant.mmpa.coils import CoilLayer as CoilLayer
from lpvhinf.plant.mmpa.coils import CoilWrench as CoilWrench
from lpvhinf.plant.mmpa.coils import coil_layers as coil_layers
from lpvhinf.plant.mmpa.commutation import coil_weights as coil_weights
from lpvhinf.plant.mmpa.commutation import weighted_pseudo_inverse as weighted_pseudo_inverse
from lpvhinf.plant.mmpa.magnets import FirstHarmonicField as FirstHarmonicField
from lpvhinf.plant.mmpa.magnets import MagnetArray as MagnetArray
from lpvhinf.plant.mmpa.magnets import magnet_array as magnet_array
from lpvhinf.plant.mmpa.parameters import MMPAParameters as MMPAParameters
from lpvhinf.plant.mmpa.plate import RitzPlate as RitzPlate
from lpvhinf.plant.mmpa.sensors import InterferometerMap as InterferometerMap
from lpvhinf.plant.mmpa.wrench import SeparableWrench as SeparableWrench
