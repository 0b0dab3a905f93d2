"""A report in a real browser: it plays, it obeys, and it shows the numbers of the run and no others."""

from __future__ import annotations

import csv
import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Playwright, sync_playwright

from passiflex import Run, audit, load_scenario, shipped_scenario, simulate
from passiflex.reports import write_report
from passiflex.scenarios.scenario import Tool
from reports.browser import (
    CANVAS,
    DESKTOP,
    NO_WEBGL,
    SOFTWARE_WEBGL,
    Report,
    colours,
    executable,
    number,
    started,
)
from reports.surfaces import MISTOLD, touching

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
HOSTILE = "<img src=x onerror=window.hacked=1>"
PHONE = (844, 390)


@pytest.fixture(scope="module")
def iiwa() -> Run:
    """Return 3 s of Fig. 1's task, sampled at 1 kHz: a step and a push."""
    scenario = shipped_scenario("fig1_sampled")
    step = scenario.reference[0].model_copy(update={"at": 0.5})
    push = scenario.forces[0].model_copy(update={"start": 1.5, "end": 2.0})
    return simulate(scenario.model_copy(update={"duration": 3.0, "reference": (step,), "forces": (push,)}))


@pytest.fixture(scope="module")
def arm() -> Run:
    """Return 1 s of an arm of three joints with a tool, whose names hold HTML."""
    tool = Tool(position=(0.05, 0.02, 0.1), rotation_vector=(0.3, 0.2, 0.1))
    scenario = load_scenario(EXAMPLES / "arm3_step.yaml").model_copy(update={"tool": tool, "duration": 1.0})
    run = simulate(scenario)
    return Run(run.data.assign_attrs(name=HOSTILE, robot=HOSTILE))


@pytest.fixture(scope="module")
def playwright() -> Iterator[Playwright]:
    executable()
    with sync_playwright() as running:
        yield running


@pytest.fixture(scope="module")
def chromium(playwright: Playwright) -> Iterator[Browser]:
    with started(playwright, *SOFTWARE_WEBGL) as running:
        yield running


@pytest.fixture(scope="module")
def opened(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Report]]:
    """Return what opens a report in a window of its own."""
    contexts: list[BrowserContext] = []

    def opens(
        run: Run,
        size: tuple[int, int] = DESKTOP,
        scheme: str = "light",
        fragment: str = "",
        others: tuple[Run, ...] = (),
        notices: tuple[str, ...] = (),
    ) -> Report:
        path = write_report(run, tmp_path_factory.mktemp("report") / "report.html", others, notices)
        context = chromium.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, accept_downloads=True
        )
        contexts.append(context)
        return Report(context, path, fragment)

    yield opens
    for context in contexts:
        context.close()


@pytest.fixture(scope="module")
def window(opened: Callable[..., Report], iiwa: Run) -> Report:
    return opened(iiwa)


@pytest.fixture
def report(window: Report) -> Iterator[Report]:
    """Return the iiwa's report as it is when it is opened; whatever is done with it, nothing may go wrong."""
    window.call("pause")
    window.call("speed", 1)
    window.page.mouse.move(2, 2)
    window.page.keyboard.press("z")
    window.at(0.0)
    yield window
    assert window.errors == []
    assert window.requests == []


@pytest.mark.parametrize(("ci", "outcome"), [("", pytest.skip.Exception), ("true", pytest.fail.Exception)])
def test_where_no_browser_is_the_tests_are_skipped_but_fail_in_ci(
    monkeypatch: pytest.MonkeyPatch, ci: str, outcome: type[BaseException]
) -> None:
    monkeypatch.setenv("CI", ci)
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("PASSIFLEX_BROWSER", raising=False)
    with pytest.raises(outcome, match="`make browser` installs it"):
        executable()


# --- playing ---------------------------------------------------------------------------------------


def test_it_opens_with_nothing_wrong_and_asks_for_nothing(report: Report, iiwa: Run) -> None:
    assert iiwa.name in report.page.title()
    assert report.header["duration"] == iiwa.time[-1]
    assert not report.call("playing")
    report.keep("desktop-light")


@pytest.mark.parametrize("speed", [0.25, 1])
def test_it_plays_in_real_time_at_the_chosen_speed_and_pauses(report: Report, speed: float) -> None:
    report.page.get_by_label("speed", exact=True).select_option(str(speed))
    report.button("play").click()
    started, begin = time.monotonic(), report.call("time")
    time.sleep(0.5)
    played, watched = report.call("time") - begin, time.monotonic() - started
    assert report.call("playing")
    assert 0.1 * speed * watched < played < 1.1 * speed * watched + 0.1
    report.button("pause").click()
    stopped = report.call("time")
    time.sleep(0.2)
    assert report.call("time") == stopped
    assert not report.call("playing")


def test_it_stops_at_the_end_and_starts_again(report: Report, iiwa: Run) -> None:
    report.at(iiwa.time[-1] - 0.05)
    report.call("play")
    report.page.wait_for_function("() => !window.passiflex.playing()")
    assert report.call("time") == iiwa.time[-1]
    report.call("play")
    report.page.wait_for_function("() => window.passiflex.time() > 0 && window.passiflex.time() < 3")


def test_the_keyboard(report: Report, iiwa: Run) -> None:
    keys, now = report.page.keyboard, lambda: report.call("time")
    keys.press("Space")
    report.page.wait_for_function("() => window.passiflex.playing() && window.passiflex.time() > 0")
    keys.press("Space")
    assert not report.call("playing")
    report.at(1.0)
    keys.press("ArrowRight")
    after = now()
    assert after > 1.0
    keys.press("ArrowLeft")
    assert now() == pytest.approx(1.0, abs=1e-9)
    keys.press("End")
    assert now() == iiwa.time[-1]
    keys.press("Home")
    assert now() == 0.0
    keys.press("w")
    assert now() == pytest.approx(audit(iiwa).time, abs=1e-9)


def test_a_fragment_of_the_address_seeks(opened: Callable[..., Report], arm: Run) -> None:
    report = opened(arm, fragment="#t=0.625")
    assert report.call("time") == pytest.approx(0.625)


# --- the diagrams ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["energy", "port", "tracking", "torque"])
def test_a_click_in_a_diagram_seeks_to_the_time_under_it(report: Report, iiwa: Run, kind: str) -> None:
    plot = report.plot(kind)
    x = round(plot.left + 0.37 * plot.width)
    report.page.mouse.click(x, plot.top + plot.height / 2)
    pixel = iiwa.time[-1] / plot.width
    assert report.call("time") == pytest.approx((x - plot.left) * pixel, abs=pixel)


def test_hovering_reads_the_values_under_the_pointer(report: Report, iiwa: Run) -> None:
    plot = report.plot("energy")
    report.page.mouse.move(plot.left + 0.6 * plot.width, plot.top + 0.5 * plot.height)
    report.drawn()
    row = np.abs(iiwa.time - 0.6 * iiwa.time[-1]).argmin()
    near = iiwa["tank_energy"][max(row - 20, 0) : row + 20]
    read = report.legend("energy")[report.label("energy", "energies", "tank")]
    assert read.endswith(" J")
    assert near.min() - 1e-3 <= number(read) <= near.max() + 1e-3
    assert report.call("time") == 0.0
    report.keep("hover")


def test_a_drag_zooms_all_diagrams_and_a_double_click_undoes_it(report: Report, iiwa: Run) -> None:
    plot = report.plot("tracking")
    y = plot.top + plot.height / 2
    report.page.mouse.move(plot.left + 0.25 * plot.width, y)
    report.page.mouse.down()
    report.page.mouse.move(plot.left + 0.5 * plot.width, y, steps=5)
    report.page.mouse.up()
    report.drawn()
    report.keep("zoomed")
    assert report.call("time") == 0.0
    for kind in ("torque", "energy"):
        other = report.plot(kind)
        report.page.mouse.click(other.left + 0.5 * other.width, other.top + other.height / 2)
        pixel = 0.25 * iiwa.time[-1] / other.width
        assert report.call("time") == pytest.approx(0.375 * iiwa.time[-1], abs=4 * pixel)
    report.page.mouse.dblclick(plot.left + 0.5 * plot.width, y)
    report.page.mouse.click(plot.left + 0.5 * plot.width, y)
    assert report.call("time") == pytest.approx(0.5 * iiwa.time[-1], abs=0.02)


def test_the_keyboard_zooms_and_shows_the_worst_moment_near_by(report: Report, iiwa: Run) -> None:
    keys, worst = report.page.keyboard, report.header["verdict"]["worst_time"]
    report.at(1.0)
    whole = report.shown_times()
    assert whole == pytest.approx((iiwa.time[0], iiwa.time[-1]), abs=0.01)
    keys.press("i")
    keys.press("i")
    report.drawn()
    near = report.shown_times()
    assert near[1] - near[0] == pytest.approx((whole[1] - whole[0]) / 4, rel=0.01)
    keys.press("z")
    report.at(1.0)
    keys.press("w")
    report.drawn()
    assert report.shown_times() == pytest.approx(whole, abs=0.01)
    keys.press("w")
    report.drawn()
    expected = (max(worst - 0.25, iiwa.time[0]), min(worst + 0.25, iiwa.time[-1]))
    assert report.shown_times() == pytest.approx(expected, abs=0.005)
    keys.press("z")
    report.drawn()
    assert report.shown_times() == pytest.approx(whole, abs=0.01)


def test_one_curve_can_be_seen_alone(report: Report) -> None:
    report.choose("torque", "all joints")
    rows = report.page.locator('section[aria-label="torque over time"] .legend button')
    pressed = lambda: [row.get_attribute("aria-pressed") for row in rows.all()]  # noqa: E731
    assert pressed() == ["true"] * 7
    rows.nth(2).click(modifiers=["Shift"])
    assert pressed() == ["true" if i == 2 else "false" for i in range(7)]
    rows.nth(2).click(modifiers=["Shift"])
    assert pressed() == ["true"] * 7


def test_all_joints_are_in_sight(report: Report) -> None:
    report.choose("torque", "all joints")
    legend = report.rectangle('section[aria-label="torque over time"] .legend')
    for i in range(7):
        row = report.page.locator('section[aria-label="torque over time"] .legend li').nth(i)
        box = row.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= legend.bottom + 1
        assert row.locator(".name").evaluate("name => name.scrollWidth <= name.clientWidth")


def test_from_peak_to_peak_the_pointer_tells_a_frequency(report: Report) -> None:
    report.at(1.0)
    plot = report.plot("torque")
    start, end = report.shown_times()
    report.page.mouse.move(plot.left + plot.width * (1.1 - start) / (end - start), plot.top + 30)
    report.drawn()
    said = report.page.locator('section[aria-label="torque over time"] .distance').inner_text()
    far, frequency = (float(word) for word in re.findall(r"[0-9.]+", said))
    assert far == pytest.approx(100, abs=2 * 1000 * (end - start) / plot.width)
    assert frequency == pytest.approx(1000 / far, rel=0.01)
    report.page.mouse.move(0, 0)


# --- the numbers -----------------------------------------------------------------------------------

EXPECTED: dict[tuple[str, str, str], Callable[[Run], np.ndarray]] = {
    ("energy", "energies", "tank"): lambda run: run["tank_energy"],
    ("port", "powers", "environment"): lambda run: run["external_power"],
    ("tracking", "z", "reference"): lambda run: run["desired_position"][:, 2] - run["position"][0, 2],
    ("tracking", "distance", "proposed"): lambda run: np.linalg.norm(
        run["position"] - run["desired_position"], axis=1
    ),
    ("torque", "all joints", "joint 2"): lambda run: run["tau_m"][:, 1] / run["torque_limit"][1],
    ("torque", "joint 4", "motor"): lambda run: run["tau_m"][:, 3],
}
"""What a diagram must show, by kind, choice and the role of the curve."""
COARSE = {"all joints": 5.1e-3}
"""Many joints stand in two columns, to a hundredth of a limit."""


@pytest.mark.parametrize(("kind", "choice", "role"), EXPECTED)
def test_the_numbers_are_those_of_the_run(
    report: Report, iiwa: Run, kind: str, choice: str, role: str
) -> None:
    signal, label = EXPECTED[kind, choice, role](iiwa), report.label(kind, choice, role)
    first = next(panel["choice"] for panel in report.header["panels"] if panel["kind"] == kind)
    report.choose(kind, choice)
    for row in (0, 700, 1234, 1700, iiwa.time.size - 1):
        report.at(iiwa.time[row])
        assert report.call("value", kind, choice, label) == float(np.float32(signal[row]))
        assert number(report.legend(kind)[label]) == pytest.approx(
            signal[row], rel=5.1e-4, abs=COARSE.get(choice, 1e-12)
        )
    report.choose(kind, first)


def test_the_worst_moment_is_that_of_the_audit(report: Report, iiwa: Run) -> None:
    result = audit(iiwa)
    report.button("worst moment").click()
    report.drawn()
    assert report.call("time") == pytest.approx(result.time, abs=1e-9)
    head = report.page.locator("body").inner_text()
    assert result.verdict in head
    assert f"t = {result.time:.3f} s, margin {result.margin:.3g} J" in head
    report.keep("worst-moment")


def test_the_download_holds_the_numbers_that_are_shown(report: Report, iiwa: Run) -> None:
    with report.page.expect_download() as waiting:
        report.button("as CSV").click()
    text = Path(waiting.value.path()).read_text(encoding="utf-8-sig")
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith(("#", '"#'))))
    column = rows[0].index(f"energy / energies / {report.label('energy', 'energies', 'tank')} [J]")
    told = np.array([float(row[column]) for row in rows[1:] if row[column]])
    np.testing.assert_allclose(told, iiwa["tank_energy"], rtol=1e-6)


def test_the_configuration_can_be_copied(report: Report, iiwa: Run) -> None:
    report.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    report.button("the resolved configuration").click()
    report.button("copy the configuration").click()
    report.page.wait_for_function("async () => (await navigator.clipboard.readText()).length > 0")
    assert report.page.evaluate("() => navigator.clipboard.readText()") == report.header["configuration"]
    report.keep("configuration")
    report.page.keyboard.press("Escape")


# --- the arm ---------------------------------------------------------------------------------------


def test_the_arm_stands_where_the_run_says(
    report: Report, opened: Callable[..., Report], iiwa: Run, arm: Run
) -> None:
    for page, run in ((report, iiwa), (opened(arm), arm)):
        frames = page.header["frames"]["time"]["shape"][0]
        stride = math.ceil((run.time.size - 1) / (frames - 1))
        for row in np.array([0, 0.3, 0.6, 0.9]) * (run.time.size - 1) // stride * stride:
            page.at(run.time[int(row)])
            np.testing.assert_allclose(page.call("tip"), run["position"][int(row)], atol=1e-5)


def test_the_picture_of_the_arm_is_not_blank_and_moves(report: Report) -> None:
    before = report.scene()
    assert colours(before) > 50
    report.at(2.0)
    after = report.scene()
    assert np.any(before != after, axis=2).sum() > 20
    point = report.call("tipOnScreen")
    canvas = report.rectangle(CANVAS)
    assert canvas.left < point["x"] < canvas.right
    assert canvas.top < point["y"] < canvas.bottom


def test_the_deflection_is_drawn_magnified_and_told_as_it_is(report: Report, iiwa: Run) -> None:
    report.at(0.7)
    slider = report.page.get_by_label("magnification of the joint deflection")
    pictures = []
    for exponent in (0, 3):
        slider.fill(str(exponent))
        report.drawn()
        pictures.append(report.scene())
        q, motor = (np.array(report.call("drawn")[name]) for name in ("q", "motor"))
        deflection = iiwa["theta"][700] - iiwa["q"][700]
        np.testing.assert_allclose(motor - q, 10**exponent * deflection, atol=1e-6 * 10**exponent)
    assert np.any(pictures[0] != pictures[1])
    told = [number(text) for text in report.page.locator(".magnifier tbody td:last-child").all_inner_texts()]
    np.testing.assert_allclose(told, 1000 * deflection, atol=6e-4)
    report.keep("magnified")


# --- what it touches --------------------------------------------------------------------------------


def test_what_touches_the_arm_is_in_the_scene_with_its_force(opened: Callable[..., Report]) -> None:
    run = touching()
    report = opened(run, scheme="dark")
    start, pressed = run["position"][0], np.linalg.norm(run["wall_force"], axis=1)
    report.at(0.0)
    apart = report.scene()
    by_name = {drawn["name"]: drawn for drawn in report.call("surfaces")}
    assert list(by_name) == ["wall", "ball", "post", "crate"]
    np.testing.assert_allclose(by_name["wall"]["at"], start + np.array([0.05, 0, 0]), atol=1e-6)
    assert all(drawn["force"] is None for drawn in by_name.values())
    assert "no contact" in report.page.locator("footer").inner_text()
    row = int(pressed.argmax()) // 5 * 5
    report.at(run.time[row])
    wall, ball, *_ = report.call("surfaces")
    np.testing.assert_allclose(wall["force"], run["wall_force"][row], rtol=1e-6)
    np.testing.assert_allclose(ball["at"], run["ball_place"][row], atol=1e-6)
    assert f"wall {pressed[row]:.3g} N" in report.page.locator(".tag.force").all_inner_texts()
    assert f"contact {pressed[row]:.3g} N" in report.page.locator("footer").inner_text()
    assert "wall, plane (longest arrow" in report.page.locator(".layers").inner_text()
    assert np.any(report.scene() != apart)
    assert report.call("value", "contact", "force", "wall") == pytest.approx(pressed[row], rel=1e-6)
    report.keep("contact")
    report.page.keyboard.press("2")
    report.drawn()
    report.keep("contact-close")
    assert (report.errors, report.requests) == ([], [])


def test_surfaces_can_be_taken_away(opened: Callable[..., Report]) -> None:
    report = opened(touching())
    before = report.pixels(report.rectangle(CANVAS))
    report.page.locator(".layers label", has_text="wall").locator("input").uncheck()
    report.drawn()
    assert report.call("surfaces")[0]["at"] is None
    assert np.any(report.pixels(report.rectangle(CANVAS)) != before, axis=2).sum() > 1000
    assert report.errors == []


@pytest.mark.parametrize("damage", MISTOLD)
def test_surfaces_of_strange_files_do_no_harm(opened: Callable[..., Report], damage: str) -> None:
    run = MISTOLD[damage]()
    report = opened(run)
    report.at(run.time[-1] / 2)
    assert report.page.evaluate("() => window.hacked") is None
    assert report.page.locator("img").count() == 0
    assert colours(report.scene()) > 20
    assert (report.errors, report.requests) == ([], [])


# --- everywhere, and with any run ------------------------------------------------------------------


def test_names_with_html_in_them_are_text(opened: Callable[..., Report], arm: Run) -> None:
    report = opened(arm, others=(arm,))
    assert report.page.title().startswith(HOSTILE)
    assert HOSTILE in report.page.locator("body").inner_text()
    assert report.page.locator("img").count() == 0
    assert report.page.evaluate("() => window.hacked") is None
    assert (report.errors, report.requests) == ([], [])
    report.keep("names-with-html")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_the_screen_and_follows_its_scheme(
    opened: Callable[..., Report], arm: Run, scheme: str
) -> None:
    report = opened(arm, scheme=scheme)
    sizes = "() => [document.documentElement, document.body].map(e => [e.scrollWidth, e.scrollHeight])"
    assert report.page.evaluate(sizes) == [list(DESKTOP)] * 2
    ground = report.page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    brightness = np.mean([float(part) for part in ground.partition("(")[2].rstrip(")").split(",")[:3]])
    assert (brightness < 80) == (scheme == "dark")
    picture = report.scene()
    assert (np.median(picture) < 100) == (scheme == "dark")
    assert report.errors == []
    report.keep(f"arm3-{scheme}")


def test_a_phone_on_its_side_shows_the_button_and_a_diagram(opened: Callable[..., Report], arm: Run) -> None:
    report = opened(arm, PHONE)
    play = report.rectangle("button[aria-label^=play]")
    plot = report.plot("energy")
    for part in (play, plot):
        assert 0 <= part.left < part.right <= PHONE[0]
        assert 0 <= part.top < part.bottom <= PHONE[1]
    assert plot.width > 150
    assert plot.height > 60
    assert report.page.evaluate("() => document.documentElement.scrollWidth") <= PHONE[0]
    assert report.errors == []
    report.keep("phone")


def test_gaps_are_shown_as_gaps_under_a_notice(opened: Callable[..., Report], arm: Run) -> None:
    data = arm.data.copy(deep=True)
    data["tank_energy"][100:] = np.nan
    notice = "tank_energy has <b>gaps</b>."
    report = opened(Run(data), notices=(notice,))
    tank = report.label("energy", "energies", "tank")
    assert notice in report.page.locator("body").inner_text()
    for row, shown in ((50, True), (150, False)):
        report.at(arm.time[row])
        value = report.call("value", "energy", "energies", tank)
        assert (value is not None) is shown
        assert math.isfinite(number(report.legend("energy")[tank])) is shown
    assert report.errors == []
    report.keep("gaps")


def test_without_motor_positions_there_are_no_dials_and_no_errors(
    opened: Callable[..., Report], arm: Run
) -> None:
    report = opened(Run(arm.data.drop_vars("theta")))
    report.at(0.2)
    assert report.errors == []
    assert colours(report.scene()) > 20


def test_without_webgl_the_diagrams_are_there_and_the_page_says_why_the_arm_is_not(
    playwright: Playwright, arm: Run, tmp_path: Path
) -> None:
    path = write_report(arm, tmp_path / "report.html")
    with started(playwright, *NO_WEBGL) as plain:
        report = Report(plain.new_context(viewport={"width": DESKTOP[0], "height": DESKTOP[1]}), path)
        assert "WebGL" in report.page.locator("body").inner_text()
        report.choose("tracking", "x")
        report.at(0.5)
        assert colours(report.pixels(report.plot("tracking"))) > 10
        label = report.label("tracking", "x", "proposed")
        assert number(report.legend("tracking")[label]) == pytest.approx(
            arm["position"][100, 0] - arm["position"][0, 0], rel=5.1e-4
        )
        report.keep("no-webgl")
