"""Write the pages of the API reference: every public name, grouped by the room that it lives in.

The names are those that `lpvhinf/__init__.py` and the `__init__.py` of each room re-export, so that a name that is
published has its page, and the pages need no care of their own.
"""

from __future__ import annotations

import ast
import inspect
from importlib import import_module
from pathlib import Path

# Room, title of its page; rooms without an entry follow under the name that they have.
TITLES = {
    "codesign": "Co-design",
    "hinfstruct": "Structured H-infinity synthesis",
    "hinfstruct.uncertainty": "Dynamic uncertainty",
    "lpv": "LPV synthesis and analysis",
    "certify": "Certificates",
    "statespace": "State spaces",
    "plant": "Plants",
    "plant.mmpa": "The planar actuator",
    "decoupling": "Decoupling",
    "controllers": "Controllers of the paper",
    "shaping": "Shaping filters",
    "problems": "Generalized plants of the paper",
    "simulation": "Set-points and simulation",
    "robustness": "Robustness",
    "export": "Export",
    "plotting": "Figures",
    "errors": "Errors",
    "progress": "Progress",
}
PACKAGE = "lpvhinf"


def reexported(module: Path) -> dict[str, str]:
    """The names that an `__init__.py` re-exports (``import X as X``), and the module that each comes from."""
    found = {}
    for node in ast.parse(module.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            found |= {alias.name: node.module for alias in node.names if alias.asname == alias.name}
    return found


def defined(module: Path) -> list[str]:
    """Public functions and classes that a file defines."""
    nodes = ast.parse(module.read_text("utf-8")).body
    return [n.name for n in nodes if isinstance(n, ast.FunctionDef | ast.ClassDef) and not n.name.startswith("_")]


def public_names(package: Path) -> dict[str, dict[str, list[str]]]:
    """Public names by room: those importable from the package itself, and those of the room alone.

    Parameters
    ----------
    package : Path
        Folder of the package.

    Returns
    -------
    dict
        Room to {"package": names, "room": names}, without modules such as `certify`, which are rooms themselves.
    """
    folders = {path.parent.name for path in package.glob("*/__init__.py") if reexported(path)}
    rooms: dict[str, dict[str, list[str]]] = {
        room: {"package": [], "room": []} for room in [*TITLES, *sorted(folders - TITLES.keys())]
    }
    for name, module in reexported(package / "__init__.py").items():
        if not inspect.ismodule(getattr(import_module(PACKAGE), name)):
            rooms[module.removeprefix(f"{PACKAGE}.")]["package"].append(name)
    for room, names in rooms.items():
        path = package.joinpath(*room.split("."))
        module = import_module(f"{PACKAGE}.{room}")
        known = reexported(path / "__init__.py") if path.is_dir() else defined(path.with_suffix(".py"))
        names["room"] = [
            name for name in known if name not in names["package"] and not inspect.ismodule(getattr(module, name))
        ]
    return {room: names for room, names in rooms.items() if names["package"] or names["room"]}


def directive(module: str, name: str) -> str:
    """The autodoc directive of one name."""
    value = getattr(import_module(module), name)
    if inspect.isclass(value):
        return f".. autoclass:: {name}\n   :members:\n   :show-inheritance:\n"
    if callable(value):
        return f".. autofunction:: {name}\n"
    return f".. py:data:: {name}\n"  # the docstring of a value is that of its type


def page(room: str, names: dict[str, list[str]]) -> str:
    """The reStructuredText of a room's page."""
    title = TITLES.get(room, room)
    module = import_module(f"{PACKAGE}.{room}")
    summary = (inspect.getdoc(module) or "").split("\n\n")[0]
    parts = [f"{title}\n{'=' * len(title)}\n", f"``{PACKAGE}.{room}``\n", summary + "\n"]
    if names["package"]:
        parts += [f"Importable from ``{PACKAGE}``\n{'-' * 60}\n", f".. currentmodule:: {PACKAGE}\n"]
        parts += [directive(PACKAGE, name) for name in names["package"]]
    if names["room"]:
        heading = f"Importable from ``{PACKAGE}.{room}``"
        parts += [f"{heading}\n{'-' * len(heading)}\n", f".. currentmodule:: {PACKAGE}.{room}\n"]
        parts += [directive(f"{PACKAGE}.{room}", name) for name in names["room"]]
    return "\n".join(parts)


def write_pages(package: Path, folder: Path) -> list[Path]:
    """Write a page for each room and their index into `folder`; files that are not among them are removed.

    A page that would not change is left alone, so that the site's next build need not read it again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rooms = public_names(package)
    texts = {f"{room.replace('.', '_')}.rst": page(room, names) for room, names in rooms.items()}
    listing = "".join(f"   {Path(name).stem}\n" for name in texts)
    texts["index.rst"] = (
        "API reference\n=============\n\nEvery public name, by the room that it lives in. ``import lpvhinf as lh`` "
        "gives the names that users need most;\nthe others are in the rooms.\n\n"
        f".. toctree::\n   :maxdepth: 1\n\n{listing}"
    )
    for name, text in texts.items():
        path = folder / name
        if not path.is_file() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    for path in folder.glob("*.rst"):
        if path.name not in texts:
            path.unlink()
    return [folder / name for name in texts]
