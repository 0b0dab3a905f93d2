"""`import passiflex` is quick: it imports nothing large, and each name comes from its room when first used."""

import ast
import pkgutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

LARGE = ("casadi", "matplotlib", "pint", "scipy", "xarray")


def modules_after(statement: str) -> set[str]:
    """Return the packages that a new interpreter has imported after a statement."""
    report = f"{statement}\nimport sys\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", report], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_the_package_imports_nothing_large() -> None:
    assert modules_after("import passiflex").isdisjoint(LARGE)


def test_the_subprocess_reports_what_it_imported() -> None:
    assert "pint" in modules_after("import pint")


def test_every_public_name_can_be_listed_and_used() -> None:
    import passiflex

    assert all(getattr(passiflex, name) is not None for name in dir(passiflex) if not name.startswith("_"))


@pytest.mark.parametrize("package", ["passiflex", "passiflex.control", "passiflex.simulation"])
def test_names_that_come_late_are_those_that_a_type_checker_sees(package: str) -> None:
    """And none is that of a module, whose import would put it in the place of the name."""
    module = import_module(package)
    (seen,) = (
        node
        for node in ast.parse(Path(str(module.__file__)).read_text()).body
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
    )
    names = {alias.asname for line in seen.body if isinstance(line, ast.ImportFrom) for alias in line.names}
    homes = vars(module).get("_HOMES") or vars(module)["_ROOMS"]
    assert names == set(homes)
    assert names <= set(dir(module))
    assert names.isdisjoint(found.name for found in pkgutil.iter_modules(module.__path__))
    for name in names:
        assert getattr(module, name).__name__ == name


def test_an_unknown_name_is_an_attribute_error() -> None:
    import passiflex

    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        passiflex.simulat  # noqa: B018
