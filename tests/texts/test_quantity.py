"""What may be written for a number with a unit, and what is said about the rest."""

import math
import subprocess
import sys

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from passiflex.texts.quantity import USUAL, Quantity, unit_factor


@pytest.mark.parametrize(
    ("unit", "written", "si"),
    [
        ("m", 3, 3.0),
        ("m", "3", 3.0),
        ("m", "1e-9", 1e-9),
        ("m", "-.5 m", -0.5),
        ("m", "10 cm", 0.1),
        ("m", "10cm", 0.1),
        ("s", "5 ms", 0.005),
        ("s", "3 ms", 0.003),
        ("s", "2 min", 120.0),
        ("s", "7 µs", 7e-6),
        ("N/m", "60 N/m", 60.0),
        ("N/m", "6 N/cm", 600.0),
        ("N s/m", "20 N*s/m", 20.0),
        ("N m", "2 N m", 2.0),
        ("N m", "2 N·m", 2.0),
        ("N m/rad", "60 N m", 60.0),
        ("N m", "60 N m/rad", 60.0),
        ("rad", "2", 2.0),
        ("rad", "180 deg", math.pi),
        ("rad", "180°", math.pi),
        ("kg m^2", "3 kg m^2", 3.0),
        ("kg m^2", "3 kg m²", 3.0),
        ("kg m^2", "3 kg cm^2", 3e-4),
        ("(N m)^2", "0.2 (N m)^2", 0.2),
        ("(N m)^2", "0.2 N^2 m^2", 0.2),
        ("1/s", "5 1/s", 5.0),
        ("1/s", "5/s", 5.0),
        ("1/kg", "1e-9 1/kg", 1e-9),
        ("J", "2 mJ", 0.002),
        ("1", "50 %", 0.5),
        ("1", "-55%", -0.55),
        ("m", {"value": 3, "unit": "mm"}, 0.003),
        ("m", {"value": 3}, 3.0),
        ("m", {"value": "3", "unit": "mm"}, 0.003),
    ],
)
def test_one_number(unit, written, si):
    assert Quantity(unit).convert(written) == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize(
    ("wanted", "spellings", "si"),
    [
        (
            "N m/rad",
            "Nm/rad, N·m/rad, N⋅m/rad, N*m/rad, N-m/rad, N.m/rad, N m rad^-1, N·m·rad⁻¹, N m / rad, N\u00a0m/rad",
            1.0,
        ),
        ("N m/rad", "kNm/rad, kN m/rad, kN·m·rad⁻¹, J/mrad, Nmm/µrad", 1000.0),
        ("N m/rad", "Nm/deg, Nm/°, N m/degree", 180 / math.pi),
        ("N m", "Nm, N·m, J, kN mm, Nm/rad", 1.0),
        ("N m s/rad", "Nms/rad, N m s/rad, Nm s/rad, N·m·s/rad, Nm/(rad/s), Nmsec/rad", 1.0),
        ("kg m^2", "kg m², kg·m², kgm², kgm^2, kg*m**2, kg-m^2, kg m2, kg.m², N m s²", 1.0),
        ("kg m^2", "kg cm², kgcm², kgcm^2, kg cm2", 1e-4),
        ("kg m^2", "g cm^2, gcm²", 1e-7),
        ("rad/s", "rpm, RPM, rev/min, r/min, U/min, turn/min", math.pi / 30),
        ("rad/s", "deg/s, °/s, º/s, deg s^-1", math.pi / 180),
        ("m/s", "mm/s, mm·s⁻¹", 1e-3),
        ("(N m)^2", "(Nm)^2, (N·m)², N²m², N^2 m^2", 1.0),
    ],
)
def test_a_unit_may_be_spelt_as_on_a_data_sheet(wanted, spellings, si):
    for unit in spellings.split(", "):
        assert Quantity(wanted).convert(f"1 {unit}") == pytest.approx(si, rel=1e-14), unit
        assert Quantity(wanted).convert({"value": 1, "unit": unit}) == pytest.approx(si, rel=1e-14), unit


@pytest.mark.parametrize(
    ("wanted", "unit"),
    [
        ("rad/s", "Hz"),
        ("Hz", "rad/s"),
        ("Hz", "rpm"),
        ("rad/s", "kHz"),
        ("rad/s", "1/h"),
        ("rad/s", "1/ms"),
        ("rad/s", "1/d"),
        ("rad/s", "1/min"),
        ("rad/s", "min⁻¹"),
        ("rad/s", "min^-1"),
        ("deg/s", "1/min"),
        ("rpm", "1/min"),
        ("N m s/rad", "N m min"),
    ],
)
def test_a_frequency_is_no_speed(wanted, unit):
    """To a parser for which a radian is 1, it is one: 2 pi off."""
    with pytest.raises(
        ValueError, match="of a frequency and a speed, one counts turns and the other radians"
    ):
        Quantity(wanted).convert(f"1 {unit}")


def test_si_may_leave_rad_out_and_another_dimension_is_said_as_that():
    assert [Quantity("rad/s").convert(f"3 {unit}") for unit in ("1/s", "s⁻¹", "rad/s")] == [3.0] * 3
    for other in ("m/s", "N m"):
        with pytest.raises(ValueError, match=rf"\({other}\)"):
            Quantity("rad/s").convert(f"3 {other}")


@pytest.mark.parametrize("milli", [1, 3, 5, 7, 9, 29, 57])
def test_a_conversion_rounds_as_if_si_had_been_written(milli):
    assert Quantity("s").convert(f"{milli} ms") == float(f"{milli}e-3")


@pytest.mark.parametrize(
    ("shapes", "written", "si"),
    [
        (((3,),), ["1 cm", 0.5, "2"], (0.01, 0.5, 2.0)),
        (((None,),), {"value": [1, 2], "unit": "km"}, (1000.0, 2000.0)),
        (((2, 2),), {"value": [[1, 2], [3, 4]], "unit": "cm"}, ((0.01, 0.02), (0.03, 0.04))),
        (((3,),), np.arange(3), (0.0, 1.0, 2.0)),
        (((), (3,)), "4 m", 4.0),
    ],
)
def test_lists(shapes, written, si):
    assert Quantity("m", shapes).convert(written) == si


@pytest.mark.parametrize("written", ["inf", ".inf", "inf J", math.inf, {"value": math.inf, "unit": "mJ"}])
def test_inf_only_where_it_is_allowed(written):
    assert Quantity("J", finite=False).convert(written) == math.inf
    with pytest.raises(ValueError, match="not finite"):
        Quantity("J").convert(written)


@pytest.mark.parametrize(
    ("quantity", "written", "message"),
    [
        (Quantity("N/m"), "60 N s/m", "expected N/m, one number; got '60 N s/m' (N s/m)"),
        (Quantity("N/m"), "60 foo", "expected N/m, one number; got '60 foo' (unknown unit 'foo')"),
        (Quantity("N/m"), "sixty", "expected N/m, one number; got 'sixty' (not a number with a unit)"),
        (Quantity("N/m"), True, "expected N/m, one number; got True (not a number)"),
        (Quantity("N/m"), None, "expected N/m, one number; got None (not a number)"),
        (Quantity("N/m"), math.nan, "expected N/m, one number; got nan (not a number)"),
        (Quantity("1"), "3 dB", "expected one number; got '3 dB' (not a proportional unit: 'dB')"),
        (Quantity("s", above=0), "0 s", "expected s, one number, > 0; got '0 s' (too small)"),
        (Quantity("1", least=0, most=1), "120 %", "expected one number, ≥ 0, ≤ 1; got '120 %' (too large)"),
        (Quantity("m", ((3,),)), [1, 2], "expected m, 3 numbers; got [1, 2] (2 numbers)"),
        (Quantity("m", ((3,),)), 4, "expected m, 3 numbers; got 4 (one number)"),
        (Quantity("m", ((None,),)), [], "expected m, a list of numbers; got [] (0 numbers)"),
        (
            Quantity("m", ((3,),), above=0),
            [1, 1, -1],
            "expected m, 3 numbers, > 0; got [1, 1, -1] (too small)",
        ),
        (
            Quantity("N/m", ((), (3,), (3, 3))),
            [[1, 2], [3]],
            "expected N/m, one number, 3 numbers or 3×3; got [[1, 2], [3]] (rows of different size)",
        ),
        (
            Quantity("", ((1, 1),)),
            [["1 N"]],
            "expected SI units, 1×1; got [['1 N']] (plain SI numbers only, as the units are mixed)",
        ),
        (
            Quantity("m"),
            {"value": "3 m", "unit": "m"},
            "expected m, one number; got {'value': '3 m', 'unit': 'm'} (two units)",
        ),
        (
            Quantity("m"),
            {"value": 3, "unit": 4},
            "expected m, one number; got {'value': 3, 'unit': 4} (the unit is not a text)",
        ),
        (Quantity("m"), {"valeu": 3}, "expected m, one number; got {'valeu': 3} (not a quantity)"),
    ],
)
def test_what_is_said_about_a_mistake(quantity, written, message):
    with pytest.raises(ValueError) as error:  # noqa: PT011 - the whole message is compared
        quantity.convert(written)
    assert str(error.value) == message


@pytest.mark.parametrize(
    "unit", ["m^9^9^9", "m**9**9**9", "9**9**9", "m^99999999", "m((", "import os", "/" * 70]
)
def test_the_unit_parser_evaluates_nothing_but_units(unit):
    with pytest.raises(ValueError, match=r"unknown unit|not a number"):
        Quantity("m").convert(f"3 {unit}")


@given(st.text() | st.from_regex(r"[0-9]{1,3} [a-zA-Z%^*/()µ0-9 ]{1,12}", fullmatch=True))
def test_any_text_is_a_number_or_a_value_error(text):
    try:
        got = Quantity("1", finite=False).convert(text)
    except ValueError as error:
        got = str(error)
    assert isinstance(got, float) or "\n" not in got


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_in_the_unit_itself_are_not_changed(number):
    assert Quantity("N m/rad").convert(f"{number!r} N m/rad") == number
    assert Quantity("N m/rad").convert(number) == number


def test_pint_is_not_imported_before_it_is_needed():
    code = """
import sys
import passiflex.scenarios.scenario_file
from passiflex.texts.quantity import Quantity
Quantity("s").convert("3 ms")
assert "pint" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(("unit", "wanted"), USUAL)
def test_usual_units_are_those_of_pint(unit: str, wanted: str) -> None:
    registry = pint.UnitRegistry()
    exact = registry.Quantity(1.0, registry.parse_units(unit)).to(registry.parse_units(wanted)).magnitude
    assert unit_factor(unit, wanted) == pytest.approx(exact, rel=1e-15)
    assert Quantity(wanted).convert(f"3 {unit}") == pytest.approx(3 * exact, rel=1e-15)
