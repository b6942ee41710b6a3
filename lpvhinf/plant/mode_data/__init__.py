"""A user's own plant: modes from arrays, CSV or MAT files, with actuators and sensors, as a modal model."""

from lpvhinf.plant.mode_data.actuators_sensors import Actuator as Actuator
from lpvhinf.plant.mode_data.actuators_sensors import Sensor as Sensor
from lpvhinf.plant.mode_data.mode_data import ModeData as ModeData
from lpvhinf.plant.mode_data.mode_shapes import ModeShapes as ModeShapes
from lpvhinf.plant.mode_data.own_plant import OwnPlant as OwnPlant
from lpvhinf.plant.mode_data.own_plant import own_plant as own_plant
from lpvhinf.plant.mode_data.plausibility import Plausibility as Plausibility
from lpvhinf.plant.mode_data.rigid_body import RigidBody as RigidBody
from lpvhinf.plant.mode_data.shape_fit import ShapeFit as ShapeFit
from lpvhinf.plant.mode_data.shape_fit import fit_shapes as fit_shapes
