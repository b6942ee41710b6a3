"""Controllers as they run on a machine: in discrete time, in C, JSON and MATLAB."""

from lpvhinf.export.c_code import c_code as c_code
from lpvhinf.export.controller import SampledController as SampledController
from lpvhinf.export.files import load as load
from lpvhinf.export.files import save as save
from lpvhinf.export.sampling import sampled as sampled
from lpvhinf.export.sampling import sampled_from_function as sampled_from_function
