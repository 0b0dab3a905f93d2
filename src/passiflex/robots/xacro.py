"""xacro templates, expanded by the package `xacrodoc` where it is there."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from passiflex.errors import RobotError
from passiflex.files import whole_file


def expanded(path: Path, folder: Path, arguments: Mapping[str, str] | None = None) -> Path:
    """Return the path of a plain URDF: the file itself, or a xacro template's expansion, written into a folder.

    Parameters
    ----------
    path, folder: The file, and where to write.
    arguments: Of the template.

    Raises
    ------
    RobotError
        If it is a template and the package is not there, or cannot expand it.
    """
    if path.suffix != ".xacro":
        return path
    if find_spec("xacrodoc") is None:
        raise RobotError(
            f"{path} is a xacro template",
            needs="plain URDF",
            try_="pip install 'passiflex[xacro]', or xacro itself",
        )
    from xacrodoc import XacroDoc

    try:
        made = XacroDoc.from_file(str(path), subargs=dict(arguments or {}), resolve_packages=False)
        text = made.to_urdf_string()
    except Exception as error:  # whatever a template does
        raise RobotError(
            f"{path} cannot be expanded",
            got=str(error) or type(error).__name__,
            needs="all its arguments, and the packages that it finds beside or above it",
            try_="--xacro NAME=VALUE for each argument",
        ) from error
    name = path.name.removesuffix(".xacro")
    target = folder / (name if name.endswith(".urdf") else f"{name}.urdf")
    with whole_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target
