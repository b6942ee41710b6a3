"""Plants: mechanical equations of motion, modal form, own modal data, and the planar actuator benchmark."""

from lpvhinf.plant.maps import PositionMap as PositionMap
from lpvhinf.plant.mechanical import MechanicalModel as MechanicalModel
from lpvhinf.plant.modal import ModalGains as ModalGains
from lpvhinf.plant.modal import ModalModel as ModalModel
from lpvhinf.plant.modal_form import modal_form as modal_form
from lpvhinf.plant.mode_data import Actuator as Actuator
from lpvhinf.plant.mode_data import ModeData as ModeData
from lpvhinf.plant.mode_data import ModeShapes as ModeShapes
from lpvhinf.plant.mode_data import OwnPlant as OwnPlant
from lpvhinf.plant.mode_data import Plausibility as Plausibility
from lpvhinf.plant.mode_data import RigidBody as RigidBody
from lpvhinf.plant.mode_data import Sensor as Sensor
from lpvhinf.plant.mode_data import ShapeFit as ShapeFit
from lpvhinf.plant.mode_data import fit_shapes as fit_shapes
from lpvhinf.plant.mode_data import own_plant as own_plant
