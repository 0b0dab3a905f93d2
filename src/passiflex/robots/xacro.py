"""xacro templates, expanded by the package `xacrodoc` where it is there."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from passiflex.errors import RobotError
from passiflex.files import whole_file

ARGUMENT = re.compile(r"""<xacro:arg\s+name="([^"]+)"(?:\s+default="([^"]*)")?""")


def expanded(path: Path, target: Path, arguments: Mapping[str, str] | None = None) -> Path:
    """Return the path of a plain URDF: the file itself, or a xacro template's expansion, written to `target`.

    Parameters
    ----------
    path, target: The file, and where to write; there must be no such file.
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
    if target.exists():
        raise RobotError(
            f"{path} would be expanded into a file that is there", got=str(target), try_="--out OTHER.yaml"
        )
    from xacrodoc import XacroDoc, packages

    own = next((folder for folder in path.resolve().parents if (folder / "package.xml").exists()), None)
    if own is not None:
        packages.look_in([str(own.parent)])  # where its neighbours are
    try:
        made = XacroDoc.from_file(str(path), subargs=dict(arguments or {}), resolve_packages=False)
        text = made.to_urdf_string()
    except Exception as error:  # whatever a template does
        declared = dict(ARGUMENT.findall(path.read_text(encoding="utf-8", errors="replace")))
        listed = ", ".join(f"{name}={default}" if default else name for name, default in declared.items())
        raise RobotError(
            f"{path} cannot be expanded",
            got=str(error) or type(error).__name__,
            needs="its arguments, and the packages that it finds beside or above it",
            try_=f"--xacro NAME=VALUE; its arguments and their defaults: {listed or 'none'}",
        ) from error
    with whole_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target
