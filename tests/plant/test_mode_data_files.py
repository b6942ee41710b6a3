"""Modal data to and from CSV and MAT files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from lpvhinf.errors import DimensionError, LpvHinfError, StorageError
from lpvhinf.plant import ModeData, Plausibility, RigidBody

BODY = RigidBody(
    mass=6.0,
    centre_of_gravity=[0.003, -0.002, 0.001],
    inertia=[[0.045, 0.001, -0.002], [0.001, 0.046, 0.003], [-0.002, 0.003, 0.09]],
)
X, Y = (side.ravel() for side in np.meshgrid(np.linspace(-0.15, 0.15, 6), np.linspace(-0.15, 0.15, 6)))
W = np.stack([54.0 * X * Y, 60.0 * (X**2 - Y**2), 90.0 * (X**2 + Y**2) - 1.3], axis=-1) / np.sqrt(3.0)
FREQUENCY, DAMPING = np.array([140.0, 200.0 / 3.0 * 3.1, 261.0]), np.array([0.01, 0.02, 1.0 / 300.0])
UVW = np.stack([0.1 * W, 0.2 * W, W], axis=1)
LOOSE = Plausibility(lumping=5.0, agreement=2.0, amplitude=(0.01, 9.0))
COEFFICIENTS = np.zeros((3, 2, 2))
COEFFICIENTS[1, 1, 0], COEFFICIENTS[2, 0, 1] = 40.0, 50.0 / 3.0

MADE: dict[str, Callable[[], ModeData]] = {
    "out of plane": lambda: ModeData(
        frequency_hz=FREQUENCY, damping=DAMPING, body=BODY, points=np.column_stack([X, Y]), shapes=W, limits=LOOSE
    ),
    "all components": lambda: ModeData(
        frequency_hz=FREQUENCY,
        damping=DAMPING,
        body=BODY,
        points=np.column_stack([X, Y, 0.01 * X]),
        shapes=UVW,
        modal_mass=[1.1, 1.2, 1.0 / 0.7],
        node_mass=np.full(36, 6.0 / 36.0),
        limits=LOOSE,
    ),
    "one mode": lambda: ModeData(
        frequency_hz=FREQUENCY[:1],
        damping=0.01,
        body=BODY,
        points=np.column_stack([X, Y]),
        shapes=UVW[..., :1],
        modal_mass=[2.0],
        limits=LOOSE,
    ),
    "one mode, out of plane": lambda: ModeData(
        frequency_hz=FREQUENCY[:1],
        damping=0.01,
        body=BODY,
        points=np.column_stack([X, Y]),
        shapes=W[:, :1],
        limits=LOOSE,
    ),
    "polynomials": lambda: ModeData(
        frequency_hz=FREQUENCY[:2],
        damping=DAMPING[:2],
        body=BODY,
        polynomials=COEFFICIENTS,
        area=[[-0.15, 0.15], [-0.1, 0.15]],
        limits=LOOSE,
    ),
    "polynomials of all components": lambda: ModeData(
        frequency_hz=FREQUENCY[:1],
        damping=0.01,
        body=BODY,
        polynomials=COEFFICIENTS[:, :, None, :1] * np.array([0.1, 0.2, 1.0])[:, None],
        area=[[-0.15, 0.15], [-0.1, 0.15]],
        limits=LOOSE,
    ),
    "polynomial of one mode": lambda: ModeData(
        frequency_hz=FREQUENCY[:1],
        damping=0.01,
        body=BODY,
        polynomials=COEFFICIENTS[..., :1],
        area=[[-0.15, 0.15], [-0.1, 0.15]],
        limits=LOOSE,
    ),
}


def same(one: ModeData, other: ModeData) -> bool:
    names = ("frequency_hz", "damping", "points", "shapes", "polynomials", "area", "modal_mass", "node_mass")
    pairs = [(getattr(one, name), getattr(other, name)) for name in names]
    pairs += [(getattr(one.body, name), getattr(other.body, name)) for name in ("mass", "centre_of_gravity", "inertia")]
    return all((a is None and b is None) or np.array_equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("name", MADE)
def test_csv_round_trip_keeps_every_digit(tmp_path: Path, name: str) -> None:
    data = MADE[name]()
    data.save_csv(tmp_path / "new" / "folder")
    assert same(ModeData.from_csv(tmp_path / "new" / "folder", limits=LOOSE), data)


@pytest.mark.parametrize("name", MADE)
def test_mat_round_trip_keeps_every_digit(tmp_path: Path, name: str) -> None:
    data = MADE[name]()
    data.save_mat(tmp_path / "data.mat")
    assert same(ModeData.from_mat(tmp_path / "data.mat", limits=LOOSE), data)


def test_the_other_description_is_removed_when_a_folder_is_written_again(tmp_path: Path) -> None:
    for name in ("polynomials", "out of plane", "polynomials"):
        MADE[name]().save_csv(tmp_path)
        assert same(ModeData.from_csv(tmp_path, limits=LOOSE), MADE[name]())


def test_mat_as_matlab_writes_it(tmp_path: Path) -> None:
    """Rows for columns, a diagonal for the inertia, and the last axis dropped where there is one mode."""
    plain = {
        "frequency_hz": np.array([[140.0]]),
        "damping": np.array([[0.01]]),
        "mass": np.array([[6]], dtype=np.int16),
        "centre_of_gravity": np.array([[0.0, 0.0, 0.0]]),
        "inertia": np.array([[0.045, 0.045, 0.09]]),
        "points": np.column_stack([X, Y]),
        "shapes": UVW[..., 0],
    }
    scipy.io.savemat(tmp_path / "data.mat", plain)
    data = ModeData.from_mat(tmp_path / "data.mat", limits=LOOSE)
    assert data.shapes is not None
    assert data.shapes.shape == (36, 3, 1)
    assert data.body.mass == 6.0
    assert np.array_equal(data.body.inertia, np.diag([0.045, 0.045, 0.09]))


def test_csv_as_a_spreadsheet_writes_it(tmp_path: Path) -> None:
    """With a byte-order mark, capitals, spaces, columns in another order, comments and empty lines."""
    MADE["out of plane"]().save_csv(tmp_path)
    rows = [
        f"{n},{a!r}, {b!r} ,{v[2]!r},{v[0]!r},{v[1]!r}"
        for n, (a, b, v) in enumerate(zip(Y.tolist(), X.tolist(), W.tolist()))
    ]
    text = (
        "\ufeff# from a model\r\nNode,Y_m, x_m,w3,w1,W2\r\n"
        + "\r\n".join(rows[:20])
        + "\r\n,,,,,\r\n"
        + "\r\n".join(rows[20:])
    )
    (tmp_path / "shapes.csv").write_text(text, encoding="utf-8")
    assert same(ModeData.from_csv(tmp_path, limits=LOOSE), MADE["out of plane"]())


def replaced(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))

    return change


def without(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def text(name: str, content: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / name).write_text(content)

    return change


def shorter(folder: Path) -> None:
    lines = (folder / "shapes.csv").read_text().splitlines()
    (folder / "shapes.csv").write_text("\n".join(line.rsplit(",", 1)[0] for line in lines))


@pytest.mark.parametrize(
    ("spoil", "error", "words"),
    [
        (without("modes.csv"), StorageError, "modes.csv cannot be read"),
        (without("shapes.csv"), StorageError, "has no shapes.csv, wanted one of shapes.csv and polynomials.csv"),
        (text("polynomials.csv", "power_x,power_y,w1\n0,0,1\n"), StorageError, "has both shapes.csv and"),
        (text("modes.csv", ""), StorageError, "modes.csv has 0 lines"),
        (replaced("modes.csv", "frequency_hz", "frequency"), StorageError, "column 'frequency', wanted frequency_hz"),
        (replaced("shapes.csv", "x_m", "x_mm"), StorageError, "column 'x_mm'.*states the unit: convert, then rename"),
        (replaced("shapes.csv", "w2", "u1"), StorageError, "has no column v1, u2, v2, w2"),
        (replaced("shapes.csv", "w2", "w1"), StorageError, "has a column twice"),
        (replaced("shapes.csv", "y_m", "z_m"), StorageError, "has no column y_m"),
        (replaced("shapes.csv", "-0.15", "-0.15m"), StorageError, "line 2: x_m is '-0.15m', wanted a number"),
        (replaced("shapes.csv", "-0.15,", "-0,15,"), StorageError, "line 2: 6 entries, wanted 5"),
        (text("shapes.csv", "x_m;y_m;w1\n0,1;0,2;0,3\n"), StorageError, "by semicolon or tab, wanted commas"),
        (replaced("body.csv", "quantity,value", "mass,cog"), StorageError, "wanted quantity,value"),
        (replaced("body.csv", "ixx_kgm2", "ixx_kgmm2"), StorageError, "line 6: 'ixx_kgmm2' is not known"),
        (replaced("body.csv", "mass_kg", "iyy_kgm2"), StorageError, "'iyy_kgm2' comes twice"),
        (replaced("body.csv", "mass_kg", "# mass_kg"), StorageError, "has no mass_kg"),
        (shorter, DimensionError, r"shapes has shape \(36, 2\), wanted \(36, 3\)"),
        (replaced("shapes.csv", "-0.15", "nan"), LpvHinfError, r"points\[0, 0\] is nan"),
    ],
)
def test_files_that_cannot_be_right_are_named(
    tmp_path: Path, spoil: Callable[[Path], None], error: type[LpvHinfError], words: str
) -> None:
    MADE["out of plane"]().save_csv(tmp_path)
    spoil(tmp_path)
    with pytest.raises(error, match=words):
        ModeData.from_csv(tmp_path, limits=LOOSE)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (replaced("polynomials.csv", "1.0,1.0,", "1.5,1.0,"), "whole numbers from 0 to 30"),
        (replaced("polynomials.csv", "1.0,1.0,", "1.0,0.0,"), "comes twice"),
        (replaced("body.csv", "x_min_m", "# x_min_m"), "has no x_min_m"),
    ],
)
def test_files_of_polynomials_that_cannot_be_right_are_named(
    tmp_path: Path, spoil: Callable[[Path], None], words: str
) -> None:
    MADE["polynomials"]().save_csv(tmp_path)
    spoil(tmp_path)
    with pytest.raises(StorageError, match=words):
        ModeData.from_csv(tmp_path, limits=LOOSE)


def test_mat_files_that_cannot_be_right_are_named(tmp_path: Path) -> None:
    path = tmp_path / "data.mat"
    with pytest.raises(StorageError, match="cannot be read as a MAT file"):
        ModeData.from_mat(path)
    path.write_bytes(b"no MAT file at all, whatever its name says" * 10)
    with pytest.raises(StorageError, match="cannot be read as a MAT file"):
        ModeData.from_mat(path)
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM" + bytes(400))
    with pytest.raises(StorageError, match=r"of version 7\.3"):
        ModeData.from_mat(path)
    MADE["out of plane"]().save_mat(path)
    whole = {k: v for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")}
    for change, words in (
        ({"mass": None}, "has no variable mass"),
        ({"omega": 1.0}, "has the variable omega"),
        ({"shapes": "text"}, "shapes has the type"),
        ({"shapes": W * 1j}, "shapes has the type complex128"),
        ({"points": {"x": 1.0}}, "points has the type"),
    ):
        scipy.io.savemat(path, {k: v for k, v in (whole | change).items() if v is not None})
        with pytest.raises(StorageError, match=words):
            ModeData.from_mat(path)
    scipy.io.savemat(path, whole | {"mass": [6.0, 6.0]})
    with pytest.raises(DimensionError, match="mass has shape"):
        ModeData.from_mat(path)
