"""The documented example: it runs as printed in docs/own_plant.md, and its files are those of the finite elements."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lpvhinf.errors import AssumptionError
from lpvhinf.plant import Actuator, ModeData, RigidBody, Sensor, own_plant

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLES = ROOT / "docs/examples"
DATA = EXAMPLES / "own_plant_data"
PAGE = ROOT / "docs/own_plant.md"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def python_blocks() -> list[str]:
    return re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)


def test_the_page_prints_the_script() -> None:
    text = (EXAMPLES / "own_plant.py").read_text("utf-8")
    assert python_blocks()[0] == text[text.index("import lpvhinf as lh\n") :]


@pytest.mark.slow
def test_the_script_runs_and_the_observer_damps_the_first_mode() -> None:
    run = subprocess.run(
        [sys.executable, "-W", "error", "docs/examples/own_plant.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = {line[:14].strip(): line[14:].split() for line in run.stdout.splitlines()}
    conventional, observer = (np.array(rows[name], dtype=float) for name in ("conventional", "with observer"))
    assert max(conventional[0], observer[0]) < 2.2  # gamma
    assert np.all(
        (np.array([conventional, observer])[:, 1:4] > 30.0) & (np.array([conventional, observer])[:, 1:4] < 50)
    )
    assert conventional[4] == pytest.approx(0.005, rel=0.2)
    assert observer[4] > 0.1
    assert observer[5] < 0.1 * conventional[5]


def test_the_files_are_what_the_finite_elements_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("skfem")
    script("generate_own_plant_data").main(tmp_path)
    assert "63 nodes" in capsys.readouterr().out
    made, shipped = ModeData.from_csv(tmp_path), ModeData.from_csv(DATA)
    assert np.allclose(made.omega_flex, shipped.omega_flex, rtol=1e-6)
    assert made.shapes is not None
    assert shipped.shapes is not None
    for k in range(3, 8):  # the sign of a mode is free, and the rigid-body modes may be mixed
        one, other = made.shapes[:, k], shipped.shapes[:, k]
        assert min(np.max(np.abs(one - other)), np.max(np.abs(one + other))) < 1e-4
    assert made.body.mass == shipped.body.mass
    assert np.allclose(made.body.inertia, shipped.body.inertia, rtol=1e-6)


def test_smooth_shapes_are_those_of_the_finite_elements_between_the_nodes() -> None:
    pytest.importorskip("skfem")
    model = script("generate_own_plant_data")
    data = ModeData.from_csv(DATA)
    fit = data.smooth()
    at = (np.random.default_rng(0).random((200, 2)) - 0.5) * np.array(model.SIDES)
    wanted = model.modes(at)[1][:, 3:]
    found = fit.shapes.at(at)[:, 2]
    found *= np.sign(np.sum(found * wanted, axis=0))
    error = np.sqrt(np.mean((found - wanted) ** 2, axis=0) / np.mean(wanted**2, axis=0))
    assert np.all(error < 2.0 * fit.left_out)
    assert np.max(error) < 0.015


def test_the_files_catch_a_wrong_mass() -> None:
    data = ModeData.from_csv(DATA)
    assert data.n_zero == 3
    with pytest.raises(AssumptionError, match=r"belong to a body of 6\.24.*but mass is 5\.1 kg"):
        ModeData(
            frequency_hz=data.frequency_hz,
            damping=data.damping,
            points=data.points,
            shapes=data.shapes,
            body=RigidBody(mass=5.1, centre_of_gravity=data.body.centre_of_gravity, inertia=data.body.inertia),
        )


def test_every_array_of_the_other_block_has_the_documented_shape() -> None:
    """The second block of the page builds the same plant from arrays."""
    scope: dict[str, object] = {}
    run = compile(python_blocks()[1], str(PAGE), "exec")
    exec(run, scope)
    plant = scope["plant"]
    sensors = [Sensor(place=[x, y], fixed_to="frame") for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    actuators = [Actuator(place=s.place, fixed_to="mover") for s in sensors]
    assert isinstance(scope["data"], ModeData)
    wanted = own_plant(scope["data"], actuators=actuators, sensors=sensors, box=[[-0.04, 0.04]] * 2)
    p = [[0.01, 0.02]]
    assert np.allclose(plant.modal.output_gains(p), wanted.modal.output_gains(p))  # type: ignore[attr-defined]
