"""A user's own plant, from CSV files of a finite-element model to a controller; docs/own_plant.md shows its output.

Run it from the root of a checkout: ``python docs/examples/own_plant.py``. The files come from
``generate_own_plant_data.py``.
"""

# ruff: noqa: T201

import lpvhinf as lh
from lpvhinf.codesign import measure

data = lh.ModeData.from_csv("docs/examples/own_plant_data")
corners = [(a, b) for a in (-1, 1) for b in (-1, 1)]
plant = lh.own_plant(
    data,
    actuators=[lh.Actuator(place=[0.16 * a, 0.12 * b], fixed_to="mover", gain=20.0) for a, b in corners],  # 20 N/A
    sensors=[lh.Sensor(place=[0.14 * a, 0.10 * b], fixed_to="frame") for a, b in corners],  # vertical beams
    box=[[-0.05, 0.05], [-0.05, 0.05]],  # travel in x and y [m]
    n_flex=3,  # modes with dynamics; the other two keep their compliance
)
print(plant.report())

decoupled = lh.decouple(plant, n_flex=1, degree=12)  # three axes 1/s^2 and the first flexible mode, at every p
specification = lh.Specification(f_bw=40.0, expected_error=[1e-6, 1e-5, 1e-5])  # [Hz]; z [m], rx and ry [rad]
quick = {"n_positions": 3, "starts": 1, "exchange_rounds": 0, "n_search": 4, "max_iterations": 8, "tolerance": 1e-3}
conventional = lh.codesign(decoupled, "rigid-body", specification, **quick)  # leave quick out for a real design
design = lh.codesign(decoupled, "output-observer", specification, warm_start=conventional, **quick)

print("\n                gamma  crossover z, rx, ry [Hz]  mode 1: damping   peak")
for name, one in [("conventional", conventional), ("with observer", design)]:
    at = measure(one, design.positions)
    crossover = " ".join(f"{f:5.1f}" for f in at.crossover.min(axis=0))
    print(f"{name:14s} {one.gamma:6.2f}  {crossover:>24s}  {at.damping.min():15.3f}  {at.mode_peak.max():5.1f}")
