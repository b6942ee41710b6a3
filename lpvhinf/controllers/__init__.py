"""The controllers of the paper: K_RB, K_FM and the modal observer."""

from lpvhinf.controllers.error_observer import check_observable as check_observable
from lpvhinf.controllers.error_observer import error_observer_model as error_observer_model
from lpvhinf.controllers.flexible import band_pass as band_pass
from lpvhinf.controllers.flexible import velocity_selection as velocity_selection
from lpvhinf.controllers.free_rigid_body import FreeRigidBodyStructure as FreeRigidBodyStructure
from lpvhinf.controllers.output_observer import initial_gain as initial_gain
from lpvhinf.controllers.output_observer import observer_model as observer_model
from lpvhinf.controllers.output_observer import process_noise as process_noise
from lpvhinf.controllers.output_observer import riccati_gain as riccati_gain
from lpvhinf.controllers.rigid_body import RigidBodyGains as RigidBodyGains
from lpvhinf.controllers.rigid_body import RigidBodyStructure as RigidBodyStructure
from lpvhinf.controllers.rigid_body_state_space import RigidBodyStateSpace as RigidBodyStateSpace
