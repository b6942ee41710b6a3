"""Plants: mechanical equations of motion, modal form, and the planar actuator benchmark."""

from lpvhinf.plant.maps import PositionMap as PositionMap
from lpvhinf.plant.mechanical import MechanicalModel as MechanicalModel
from lpvhinf.plant.modal import ModalGains as ModalGains
from lpvhinf.plant.modal import ModalModel as ModalModel
from lpvhinf.plant.modal_form import modal_form as modal_form
