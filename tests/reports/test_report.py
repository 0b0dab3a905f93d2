"""The report of a run says what the run says: read back as its viewer reads it, and held against the run."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from passiflex.diagrams import KINDS, Viewed, ideal_motion, panels
from passiflex.errors import PassiflexError
from passiflex.files import OutputError
from passiflex.passivity import audit, available_energy
from passiflex.reports import report, report_text, show, write_report
from passiflex.reports.metrics import sentence, verdict_header
from passiflex.reports.thinning import CLOSE
from passiflex.reports.viewer import read_viewer
from passiflex.simulation import Run
from reports.pages import VIEWER, Page, baseline, changed, continuous, page, sampled, with_nan

ROUND_OFF = {"rtol": 2**-23, "atol": 1e-30}
"""What is left of a number in single precision."""
HOSTILE = "</script><script>alert(1)</script><!-- & \u2028 \"'"


@pytest.fixture(autouse=True)
def _viewer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "read_viewer", lambda: VIEWER)


def thick(run: Run, times: int) -> Run:
    """Return the run with rows between its rows, on straight lines."""
    time = np.linspace(0, run.time[-1], times * (run.time.size - 1) + 1)
    return Run(run.data.interp(time=time).assign_attrs(run.data.attrs))


@pytest.mark.parametrize("make", [continuous, baseline, sampled])
def test_every_curve_is_the_signal_of_the_run(make) -> None:
    run = make()
    read = page(run)
    main = Viewed(run, run.name, ideal_motion(run))
    wanted = [panel for kind in KINDS for panel in panels(kind, main)]
    assert [(p["kind"], p["choice"]) for p in read.header["panels"]] == [(p.kind, p.choice) for p in wanted]
    for shown, panel in zip(read.header["panels"], wanted, strict=True):
        assert (shown["title"], shown["unit"]) == (panel.title, panel.unit)
        assert [c["label"] for c in shown["curves"]] == [c.label for c in panel.curves]
        for one, curve in zip(shown["curves"], panel.curves, strict=True):
            assert one["role"] in read.header["styles"]
            np.testing.assert_array_equal(read.array(read.header["times"][one["time"]]), curve.time)
            np.testing.assert_allclose(read.array(one["values"]), curve.values, **ROUND_OFF)
    assert len(read.header["times"]) == 1
    assert read.header["thinning"] == ""


@pytest.mark.parametrize("make", [continuous, sampled])
def test_frames_are_rows_of_the_run(make) -> None:
    run, frames = make(), page(make()).header["frames"]
    read = page(run)
    np.testing.assert_array_equal(read.array(frames["time"]), run.time)
    for name, signal in {
        "q": "q",
        "theta": "theta",
        "position": "position",
        "reference": "desired_position",
    }.items():
        np.testing.assert_allclose(read.array(frames[name]), run[signal], **ROUND_OFF)
    np.testing.assert_allclose(read.array(frames["force"]), run["wrench"][:, :3], **ROUND_OFF)
    np.testing.assert_allclose(read.array(frames["moment"]), run["wrench"][:, 3:], **ROUND_OFF)
    if not run.sampled:
        assert frames["governed"] is None
    else:
        np.testing.assert_allclose(read.array(frames["governed"]), run["governed_position"], **ROUND_OFF)


@pytest.mark.parametrize("make", [continuous, baseline, sampled])
def test_verdict_and_metrics_are_those_of_the_audit(make) -> None:
    run, result = make(), audit(make())
    header = page(run).header
    verdict = header["verdict"]
    told = {name: getattr(result, name) for name in ("verdict", "time", "margin", "term")}
    assert {name: verdict[name] for name in told} == told
    assert f"{result.margin:.4g} J" in verdict["sentence"]
    rows = {row["name"]: row for row in header["metrics"]["rows"]}
    assert rows["verdict"]["values"] == [result.verdict]
    assert rows["margin"]["values"] == [result.margin]
    assert rows["margin"]["unit"] == "J"
    assert rows["torque peak"]["values"] == [np.abs(run["tau_m"]).max()]
    assert rows["external energy"]["values"] == [run["external_energy"][-1]]
    assert ("tank energy end" in rows) == run.has_tank
    assert ("governed share" in rows) == run.sampled
    assert header["duration"] == run.time[-1]


def test_a_violated_and_an_open_verdict_say_so() -> None:
    violated = replace(audit(continuous()), verdict="violated", margin=-0.25, time=0.5)
    assert sentence(violated, 0.75) == (
        "Violated: first at 0.5 s, the links had been given more energy than there was, 0.25 J too much at "
        f"0.75 s. When it began, most of the energy went to: {violated.term}."
    )
    run = changed(continuous(), failure="it fell over")
    cut = page(run).header["verdict"]
    assert cut["remedy"] == ""  # the sentence has it
    assert verdict_header(run, violated)["remedy"] == violated.remedy
    assert cut["verdict"] == "inconclusive"
    assert cut["sentence"].startswith(
        "Inconclusive: the run ended early: it fell over. The least that was left is "
    )
    # Least at some step, so not above any row, and near the row that has least.
    left = available_energy(run)
    assert cut["margin"] == pytest.approx(left.min(), abs=1e-5)
    assert cut["margin"] <= left.min()
    assert abs(cut["worst_time"] - run.time[left.argmin()]) <= run.data.attrs["duration"] / (len(left) - 1)


def test_round_off_is_nothing() -> None:
    assert "The least that was left is 0 J, at " in sentence(replace(audit(continuous()), margin=3e-15), 0.0)


def test_what_has_no_end_is_not_left_out() -> None:
    def table(run: Run) -> dict:
        return {row["name"]: row["values"] for row in page(run).header["metrics"]["rows"]}

    assert table(continuous())["settling time"] == ["∞"]  # a run of 1 s does not settle
    assert "fell back at" not in table(sampled())


def test_what_was_run_in_words() -> None:
    told = dict(page(continuous()).header["facts"])
    assert told["robot"] == "planar2r, 2 joints"
    assert told["law"] == "impedance law for flexible joints, task position"
    assert told["stiffness K_x"] == "60 N/m"
    assert told["shaped stiffness K_e"] == "2 × K"
    assert told["control"] == "continuous time"
    assert told["tank"] == "paper's tank, 2 J at the start, T_min 0.01 J, paper accounting"
    assert told["duration"] == "1 s"
    assert dict(page(baseline()).header["facts"])["tank"] == "none"
    at_rate = dict(page(sampled()).header["facts"])
    assert at_rate["control"] == "1 kHz, no delay, plain inner loop, τ_e: true"
    assert at_rate["tank"].startswith("port tank, 2 J at the start, T_min 0.1 J")


def test_events_are_marked() -> None:
    header = page(continuous()).header
    assert {"time": 0.2, "label": "step 0.05 m"} in header["marks"]
    assert {"start": 0.5, "end": 0.6, "label": "force 1 N", "kind": "force"} in header["spans"]
    floor = header["panels"][0]["levels"]
    assert [level["value"] for level in floor] == [0.01]


def test_without_a_compared_run_the_ideal_is_the_ghost() -> None:
    run, read = continuous(), page(continuous())
    (ghost,) = read.header["ghosts"]
    assert (ghost["kind"], ghost["label"], ghost["role"], ghost["q"]) == ("ideal", "ideal", "msd", None)
    wanted = run["position"][0] + ideal_motion(run)
    np.testing.assert_allclose(read.array(ghost["position"]), wanted, **ROUND_OFF)


def test_a_compared_run_is_a_ghost_until_it_ends() -> None:
    run = continuous()
    short = Run(run.data.isel(time=slice(0, 51)))
    read = page(run, (Viewed(short, "half"),))
    assert read.header["metrics"]["columns"] == ["planar", "half"]
    (end,) = [row for row in read.header["metrics"]["rows"] if row["name"] == "end time"]
    assert end["values"] == [1.0, 0.5]
    (ghost,) = read.header["ghosts"]
    assert (ghost["kind"], ghost["label"]) == ("run", "half")
    for name in ("q", "position"):
        there = read.array(ghost[name])
        np.testing.assert_allclose(there[:51], short[name], rtol=1e-6, atol=1e-12)
        assert np.isnan(there[51:]).all()
    assert len(read.header["times"]) == 1  # the rows agree: a gap follows the end
    _, moved = read.curve("tracking", "z", ghost["role"])
    assert np.isfinite(moved[:51]).all()
    assert np.isnan(moved[51:]).all()


def test_a_compared_run_at_another_rate_keeps_its_rows() -> None:
    read = page(continuous(), (sampled(),))
    (ghost,) = read.header["ghosts"]
    times, values = read.curve("tracking", "z", ghost["role"])
    np.testing.assert_array_equal(times, sampled().time)
    np.testing.assert_allclose(values, sampled()["position"][:, 2] - sampled()["position"][0, 2], **ROUND_OFF)
    frames = read.array(read.header["frames"]["time"])
    at = np.interp(frames[frames <= 0.6], sampled().time, sampled()["position"][:, 2])
    np.testing.assert_allclose(read.array(ghost["position"])[: at.size, 2], at, rtol=1e-6)


def test_a_label_is_kept() -> None:
    header = page(continuous(), (Viewed(continuous(), "again"), baseline())).header
    assert header["metrics"]["columns"] == ["planar", "again", "baseline"]


def test_labels_differ() -> None:
    header = page(continuous(), (continuous(), continuous())).header
    assert header["metrics"]["columns"] == ["planar (1)", "planar (2)", "planar (3)"]
    assert [ghost["label"] for ghost in header["ghosts"]] == ["planar (2)", "planar (3)"]


def test_a_long_run_is_thinned_without_losing_a_peak() -> None:
    run = thick(sampled(), 15)  # 9001 rows
    data = run.data.copy(deep=True)
    data["tau_m"][4321, 0] = 77.0
    run = Run(data)
    read = page(run)
    worst = read.header["verdict"]["worst_time"]
    assert read.header["thinning"] == (
        "each plotted point is the least or the greatest of 4 rows (0.2667 ms): no peak is lost, but an "
        f"oscillation may look like a band; within 0.0167 s of {worst:.4g} s every row is there"
    )
    assert (
        page(continuous(), (run,))
        .header["thinning"]
        .startswith("each plotted point is the least or the greatest of 4 rows (0.2667 ms)")
    )
    times, values = read.curve("torque", "joint 1", "motor")
    assert times.size == values.size <= 6001 + 2 * CLOSE + 2
    near = np.abs(np.arange(run.time.size) - np.searchsorted(run.time, worst)) <= CLOSE
    shown = np.searchsorted(times, run.time[near])
    np.testing.assert_array_equal(times[shown], run.time[near])
    np.testing.assert_array_equal(values[shown], run["tau_m"][near, 0].astype("f4"))
    assert values.max() == 77.0
    assert abs(times[values.argmax()] - run.time[4321]) < 4 * 0.6 / 9000
    frames = read.array(read.header["frames"]["time"])
    assert frames.size <= 2001
    assert (frames[0], frames[-1]) == (0.0, run.time[-1])
    assert np.isin(frames, run.time).all()


def test_the_same_run_gives_the_same_bytes() -> None:
    one, other = (report_text(make(), (continuous(),)) for make in (baseline, baseline))
    assert one == other
    assert report_text(Run(continuous().data.copy(deep=True))) == report_text(continuous())


def test_nothing_of_this_machine_is_in_it() -> None:
    text = str(continuous().data.attrs["scenario"]).replace("planar2r", "/home/somebody/arm.yaml")
    written = report_text(changed(continuous(), scenario=text))
    assert "somebody" not in written
    assert "robot: arm.yaml" in Page.of(written).header["configuration"]
    assert str(Path.home()) not in report_text(continuous())


def test_the_page_can_reach_no_network() -> None:
    read = page(continuous())
    (policy,) = [a["content"] for tag, a in read.document.elements if a.get("http-equiv")]
    assert policy.startswith("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; ")
    assert not re.search(r"https?://", report_text(continuous()))
    assert not [tag for tag, a in read.document.elements if {"src", "href"} & set(a)]


def test_text_of_a_run_is_text_everywhere() -> None:
    hostile = changed(
        with_nan(continuous(), "tau_a", slice(0, 2)),
        name=HOSTILE,
        robot=HOSTILE,
        failure=HOSTILE,
        scenario=HOSTILE,
        version=HOSTILE,
        commit=HOSTILE,
        seed=HOSTILE,
    )
    written = report_text(hostile, (Viewed(continuous(), HOSTILE + "2"),), (HOSTILE,))
    read = Page.of(written)
    tags = [tag for tag, _ in read.document.elements]
    assert tags == [tag for tag, _ in page(continuous()).document.elements]
    assert tags.count("script") == 4
    assert "alert(1)</script>" not in written
    assert "\u2028" not in written.split("<body>")[1]
    assert read.document.text("title") == HOSTILE
    assert read.header["title"] == HOSTILE
    assert read.header["notices"][0] == HOSTILE
    assert read.header["configuration"] == HOSTILE
    assert read.header["metrics"]["columns"] == [HOSTILE, HOSTILE + "2"]
    assert read.document.text("script") == "\n" + VIEWER.script + "\n"


def test_text_that_is_no_unicode(tmp_path: Path) -> None:
    written = write_report(changed(continuous(), name="a\udc80b"), tmp_path / "page.html")
    assert "<title>a?b</title>" in written.read_text(encoding="utf-8")


def test_a_report_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_report(continuous(), tmp_path / "new" / "page.html")
    assert path.read_text(encoding="utf-8") == report_text(continuous())
    assert [p.name for p in path.parent.iterdir()] == ["page.html"]
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot write .*page\.html"):
        write_report(continuous(), tmp_path / "file" / "page.html")


def test_show_writes_among_the_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Path] = []
    monkeypatch.setattr(report, "open_in_browser", opened.append)
    monkeypatch.setattr(report.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    assert show(changed(continuous(), name="../a run")) == tmp_path / "_a_run.html"
    assert show(continuous(), tmp_path / "there.html") == tmp_path / "there.html"
    assert opened == [tmp_path / "_a_run.html"]


def test_the_real_viewer_stands_in_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        viewer = read_viewer()
    except PassiflexError:
        pytest.skip("the viewer is not built")
    monkeypatch.setattr(report, "read_viewer", lambda: viewer)
    text = report_text(thick(sampled(), 50), (continuous(),))  # 30001 rows
    assert len(text.encode()) < 3e6
    document = Page.of(text).document
    assert document.text("script") == f"\n{viewer.script}\n"
    assert [tag for tag, _ in document.elements].count("script") == 4
