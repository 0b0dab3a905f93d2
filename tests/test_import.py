"""`import passiflex` is quick: it imports nothing large, and each name comes from its room when first used."""

import subprocess
import sys

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


def test_an_unknown_name_is_an_attribute_error() -> None:
    import passiflex

    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        passiflex.simulat  # noqa: B018
