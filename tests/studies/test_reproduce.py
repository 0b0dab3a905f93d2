"""The paper's figures: the files, the numbers of the summary, and (slow) what the paper says of them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from passiflex.errors import NameUnknownError
from passiflex.files import OutputError
from passiflex.simulation import Run, Scenario
from passiflex.studies import paper, shipped_scenario
from passiflex.studies.reproduce import FIGURES, STUDIES, reproduce

COMPARED = ("proposed", "baseline", "baseline_motor_aware")
STEP_NUMBERS = {"overshoot", "settling_time", "peak_y", "rms_to_msd", "verdict", "ledger_residual"}
EFFORT = {"tank_energy_end", "tank_energy_min", "supplied_energy", "motor_torque_peak"}
CIRCLE_NUMBERS = {
    "total_energy_start",
    "total_energy_end",
    "total_energy_rise",
    "tank_energy_end",
    "tank_energy_min",
    "reference_rms",
}


def shortened(name: str) -> Scenario:
    """Return a shipped scenario with the same events, much earlier."""
    scenario = shipped_scenario(name)
    if name == "fig2":
        step, circle = scenario.reference
        events = (step.model_copy(update={"at": 0.5}), circle.model_copy(update={"at": 1.5}))
        return scenario.model_copy(update={"duration": 6.0, "reference": events})
    (step,), (push,) = scenario.reference, scenario.forces
    changes: dict[str, Any] = {
        "duration": 1.0,
        "reference": (step.model_copy(update={"at": 0.3}),),
        "forces": (push.model_copy(update={"start": 0.7, "end": 0.8}),),
    }
    return scenario.model_copy(update=changes)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "shipped_scenario", shortened)


def refuse(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON")


def summary(folder: Path) -> dict[str, Any]:
    """Return the summary, of JSON as it is defined: without NaN and Infinity."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse)


def check_pictures(folder: Path, name: str) -> None:
    png, pdf = ((folder / f"{name}{suffix}").read_bytes() for suffix in (".png", ".pdf"))
    assert png.startswith(b"\x89PNG\r\n")
    assert pdf.startswith(b"%PDF-")
    assert b"%%EOF" in pdf[-20:]
    assert len(png) > 20_000
    assert len(pdf) > 5_000


@pytest.mark.usefixtures("short")
def test_fig_2(tmp_path: Path) -> None:
    said: list[str] = []
    written = reproduce(["fig2"], tmp_path / "new", said.append)
    paths = [p for group in written.values() for p in group]
    assert sorted(p.name for p in paths) == sorted(p.name for p in (tmp_path / "new").iterdir())
    assert {p.name for p in paths} == {
        "fig2.png",
        "fig2.pdf",
        "fig2.html",
        "fig2_proposed.nc",
        "fig2_static_proposed.nc",
        "summary.json",
    }
    check_pictures(tmp_path / "new", "fig2")
    page = (tmp_path / "new" / "fig2.html").read_text(encoding="utf-8")
    assert "<title>" in page
    assert len(page) < 3e6
    assert Run.load(tmp_path / "new" / "fig2_static_proposed.nc").name == "fig2_static"
    assert said == ["fig2: proposed", "fig2_static: proposed", "fig2: drawing and writing"]
    numbers = summary(tmp_path / "new")
    assert set(numbers) == {"source", "fig2", "fig2_static"}
    for case in ("fig2", "fig2_static"):
        assert set(numbers[case]) >= CIRCLE_NUMBERS | {"verdict"}
        assert numbers[case]["verdict"] == "passive"
        assert numbers[case]["total_energy_start"] == pytest.approx(2)
        assert numbers[case]["total_energy_rise"] < 1e-6
        assert 0 < numbers[case]["reference_rms"] < 0.1


@pytest.mark.usefixtures("short")
def test_fig_1_beside_what_was_there(tmp_path: Path) -> None:
    """A figure's part replaces its own earlier one, and leaves those of the other figures."""
    source = _source()
    earlier = {"source": source, "fig2": {"verdict": "passive"}, "fig1": "outdated"}
    (tmp_path / "summary.json").write_text(json.dumps(earlier))
    reproduce(["fig1"], tmp_path)
    numbers = summary(tmp_path)
    assert numbers["fig2"] == {"verdict": "passive"}
    assert numbers["source"] == source
    check_pictures(tmp_path, "fig1")
    for case in ("fig1", "fig1_static"):
        for name in (*COMPARED, "msd", "msd_natural"):
            assert set(numbers[case][name]) >= STEP_NUMBERS, (case, name)
            assert numbers[case][name]["verdict"] == "passive"
        assert set(numbers[case]["proposed"]) >= EFFORT
        assert numbers[case]["msd"]["rms_to_msd"] == 0
        # The step is at 0.3 s and the push at 0.7 s: nothing has settled by then, which JSON can only call null.
        assert numbers[case]["proposed"]["settling_time"] is None
        for law in COMPARED:
            assert (tmp_path / f"{case}_{law}.nc").is_file()


def _source() -> dict[str, str]:
    from passiflex.origin import package_version, source_commit

    return {"version": package_version(), "commit": source_commit()}


@pytest.mark.parametrize(
    "earlier",
    ["", "not JSON", "[1, 2]", "3", '{"fig1": 1}', '{"source": {"version": "0"}, "fig1": 1}'],
)
def test_a_summary_of_another_version_or_no_summary_is_replaced(tmp_path: Path, earlier: str) -> None:
    from passiflex.studies.reproduce import _write_summary

    (tmp_path / "summary.json").write_text(earlier)
    _write_summary(tmp_path / "summary.json", {"fig2": {"a": 1.5, "b": None}})
    assert summary(tmp_path) == {"source": _source(), "fig2": {"a": 1.5, "b": None}}


def test_a_figure_that_the_paper_does_not_have(tmp_path: Path) -> None:
    with pytest.raises(NameUnknownError) as error:
        reproduce(["fig9"], tmp_path / "new")
    assert str(error.value).startswith(
        f"unknown figure; got 'fig9'; needs one of {', '.join(sorted((*FIGURES, *STUDIES)))}; try 'fig"
    )
    assert not (tmp_path / "new").exists()


@pytest.mark.usefixtures("short")
def test_all_names_are_checked_before_any_figure_is_run(tmp_path: Path) -> None:
    with pytest.raises(NameUnknownError):
        reproduce(["fig2", "fig9"], tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.mark.usefixtures("short")
def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(OutputError, match="cannot write") as error:
        reproduce(["fig2"], tmp_path / "taken")
    assert "\n" not in str(error.value)
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def finite(numbers: Any) -> bool:
    if isinstance(numbers, dict):
        return all(map(finite, numbers.values()))
    return not isinstance(numbers, float) or math.isfinite(numbers)


@pytest.mark.slow
def test_what_the_paper_says(tmp_path: Path) -> None:
    written = reproduce([], tmp_path)
    assert set(written) == {"fig1", "fig2", "fig3", "summary"}
    for name in ("fig1", "fig2", "fig3"):
        check_pictures(tmp_path, name)
    numbers = summary(tmp_path)
    assert finite(numbers)

    fig1, fig3 = numbers["fig1"], numbers["fig3"]
    for case in (fig1, numbers["fig1_static"]):
        for name in COMPARED:
            assert set(case[name]) >= STEP_NUMBERS
            assert case[name]["verdict"] == "passive"
        # Fig. 1: less overshoot and settled sooner than the law for rigid robots, and nearer to the ideal.
        assert case["proposed"]["overshoot"] < case["baseline"]["overshoot"]
        settled = {name: case[name]["settling_time"] or math.inf for name in COMPARED}
        assert settled["proposed"] < settled["baseline"] / 2
        assert case["proposed"]["rms_to_msd"] < case["baseline"]["rms_to_msd"]
        # A law that knows its motors is as good as the ideal: the joints hardly bend at 60 N/m.
        assert case["baseline_motor_aware"]["rms_to_msd"] < case["proposed"]["rms_to_msd"]
        assert case["proposed"]["tank_energy_min"] > 0
    # Gravity, exactly compensated, changes nothing.
    assert numbers["fig1_static"]["proposed"]["overshoot"] == pytest.approx(
        fig1["proposed"]["overshoot"], abs=1e-4
    )

    # Fig. 2: the total energy stays, up to the integrator and the last of the step (1e-4 J), and never rises.
    for name in ("fig2", "fig2_static"):
        circle = numbers[name]
        assert set(circle) >= CIRCLE_NUMBERS
        assert circle["verdict"] == "passive"
        assert circle["total_energy_rise"] <= 10 * max(circle["integration_error"], circle["books_error"])
        assert circle["total_energy_end"] == pytest.approx(circle["total_energy_start"], abs=1e-3)
        assert circle["tank_energy_min"] > 0.01

    # Fig. 3: passive in spite of model errors and noise; without noise, near Fig. 1.
    for case in ("fig3", "fig3_noise_free"):
        assert numbers[case]["proposed"]["verdict"] == "passive"
        assert numbers[case]["proposed"]["books_error"] > 10 * numbers[case]["proposed"]["integration_error"]
    noise_free = numbers["fig3_noise_free"]["proposed"]
    assert noise_free["overshoot"] == pytest.approx(fig1["proposed"]["overshoot"], abs=0.02)
    assert noise_free["rms_to_msd"] == pytest.approx(fig1["proposed"]["rms_to_msd"], abs=0.02)
    assert fig3["proposed"]["overshoot"] < fig1["baseline"]["overshoot"]

    # Its honest limit: with gravity in the plant, a model 50 % too light lets the arm sag.
    sagged = numbers["fig3_static"]["proposed"]
    assert sagged["offset_before_step"] < -0.3
    assert sagged["verdict"] == "passive"
