"""From modal form to independent axes: rigid-body and extended modal decoupling."""

from lpvhinf.decoupling.construction import decouple as decouple
from lpvhinf.decoupling.coupling import ChannelCoupling as ChannelCoupling
from lpvhinf.decoupling.decoupled_plant import DecoupledPlant as DecoupledPlant
from lpvhinf.decoupling.gains import DecoupledGains as DecoupledGains
from lpvhinf.decoupling.structure import StructureReport as StructureReport
from lpvhinf.decoupling.transformations import input_decoupling as input_decoupling
from lpvhinf.decoupling.transformations import output_decoupling as output_decoupling
