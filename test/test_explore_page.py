"""The explorer's page in a real headless browser, and the command that serves it."""

from __future__ import annotations

import json
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

pytest.importorskip("viser", reason="the explorer needs the extra 'explore'")

from helmet_sim_ros import ImpactSetup, evaluate, simulate
from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.explore.page import Page
from helmet_sim_ros.explore.server import address, free_port, start_server
from helmet_sim_ros.explore.session import digest

BROWSERS = map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
CHROMIUM = next(filter(None, BROWSERS), None)
DRIVER = shutil.which("chromedriver")
PATIENCE = 90.0
SPEED = "normal velocity [m/s]"


def until(condition, seconds: float = PATIENCE):
    """Wait for a true value and return it."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.02)  # a browser: nothing tells of what it has drawn
    raise AssertionError(f"not within {seconds:g} s: {condition}")


class View:
    """What a user sees and does in the browser."""

    def __init__(self, driver, page: Page) -> None:
        self.driver, self.page = driver, page

    def find(self, xpath: str, which: int = 0):
        from selenium.webdriver.common.by import By

        return until(lambda: [e for e in self.driver.find_elements(By.XPATH, xpath)
                              if e.is_displayed()])[which]  # fmt: skip

    def shown(self) -> list[tuple[str, str, float]]:
        """Side, digest and peak_g as they stand on the page, read in one go."""
        rows = self.driver.execute_script(
            "return [...document.querySelectorAll('[data-digest]')].map(e => [e.dataset.side,"
            " e.dataset.digest, (document.querySelector('[data-criterion=peak_g]"
            "[data-side=' + e.dataset.side + ']') || {dataset: {}}).dataset.value])"
        )
        return [(side, name, float(value)) for side, name, value in rows if value is not None]

    def settle(self, side: str = "A") -> tuple[str, float]:
        """Wait until the page shows the setup as it is; its digest and peak."""

        def done():
            if not self.page.session.wait_idle(PATIENCE):
                return None
            wanted = self.page.session.slot(side).digest
            return [(d, peak) for s, d, peak in self.shown() if s == side and d == wanted]

        return until(done)[0]

    def control(self, label: str):
        field = self.find(f"//label[normalize-space(.)='{label}']")
        return self.find(f"//*[@id='{field.get_attribute('for')}']")

    def thumb(self, label: str):
        from selenium.webdriver.common.by import By

        return self.control(label).find_element(By.CSS_SELECTOR, "[role=slider]")

    def press(self, thumb, key: str, value: float) -> None:
        """Press a key on a slider and wait until it has this value."""
        thumb.send_keys(key)
        until(lambda: abs(float(thumb.get_attribute("aria-valuenow")) - value) < 1e-6)

    def choose(self, label: str, option: str) -> None:
        self.find(f"//label[normalize-space(.)='{label}']/following::input[1]").click()
        self.find(f"//*[@role='option'][normalize-space(.)='{option}']").click()

    def click(self, text: str, last: bool = False) -> None:
        self.driver.execute_script(  # viser's warning of slow graphics lies over the page
            "document.querySelectorAll('.mantine-Notifications-root').forEach(e => e.remove())"
        )
        self.find(f"//*[normalize-space(text())='{text}']", -1 if last else 0).click()

    def text(self, selector: str) -> str:
        return self.driver.execute_script(
            "return [...document.querySelectorAll(arguments[0])].map(e => e.innerText).join('|')",
            selector,
        )


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no chromium with chromedriver on this machine")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
                     "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
                     "--window-size=1000,700"):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(PATIENCE)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def opened(browser):
    """One page for all tests: without a graphics card a browser needs seconds to load it."""
    server = start_server(8400)
    page = Page(server)
    page.start()
    browser.get(address(server))
    yield View(browser, page)
    browser.get("about:blank")
    page.close()
    server.stop()


@pytest.fixture
def view(opened):
    """The page with the default setup alone."""
    if opened.page.session.has("B"):
        opened.page._compare.value = False
    opened.page._load({})
    opened.click("Setup")
    opened.click("Impact", last=True)  # a folder on the left is called so too
    opened.settle()
    return opened


@pytest.fixture
def server():
    server = start_server(8500)
    yield server
    server.stop()


def peak(**setup) -> float:
    return evaluate(simulate(ImpactSetup(**setup))).peak_g.value


def test_the_page_shows_the_impact_that_simulate_gives_and_asks_no_other_host(view):
    from selenium.webdriver.common.by import By

    assert view.settle() == (digest(ImpactSetup().described()), peak())
    assert until(lambda: view.driver.find_elements(By.TAG_NAME, "canvas"))
    severe = [e for e in view.driver.get_log("browser") if e["level"] == "SEVERE"]
    assert [e["message"] for e in severe if "favicon" not in e["message"]] == []
    requests = []
    for entry in view.driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            requests.append(message["params"]["request"]["url"])
    local = ("http://127.0.0.1", "data:", "blob:")
    assert requests and [url for url in requests if not url.startswith(local)] == []


def test_a_moved_slider_gives_the_peak_of_the_new_setup(view):
    from selenium.webdriver.common.keys import Keys

    thumb = view.thumb(SPEED)
    for tenths in range(51, 56):
        view.press(thumb, Keys.ARROW_RIGHT, tenths / 10)
    until(lambda: view.page.session.slot("A").setup.normal_velocity == 5.5)
    assert view.settle()[1] == peak(normal_velocity=5.5)
    charts = view.driver.execute_script(
        "return Object.values(window.__viserTestpoints.uplots).map(u => u.chart).map(c =>"
        " [c.series[1].label, Math.max(...c.data[1])])"
    )
    assert any(value == pytest.approx(peak(normal_velocity=5.5)) for _, value in charts)


def test_while_a_slider_moves_fast_everything_shown_belongs_to_one_setup(view):
    from selenium.webdriver.common.keys import Keys

    thumb = view.thumb(SPEED)
    seen = set()
    for step in range(30):
        thumb.send_keys(Keys.ARROW_RIGHT if step < 20 else Keys.ARROW_LEFT)
        seen.update(view.shown())

    # A slow browser drops strokes: what its slider says is what counts.
    def agreed() -> str | None:
        last = thumb.get_attribute("aria-valuenow")
        computed = view.page.session.slot("A").setup.normal_velocity
        return last if computed == pytest.approx(float(last)) != 5.0 else None

    last = until(agreed)
    seen.add(("A", *view.settle()))
    known = {}
    for tenths in range(50, 71):
        setup = ImpactSetup(normal_velocity=tenths / 10)
        known[digest(setup.described())] = setup
    assert len(seen) >= 2  # how many a browser without a graphics card gets to see varies
    for _, name, value in seen:
        assert value == evaluate(simulate(known[name])).peak_g.value
    assert known[view.settle()[0]].normal_velocity == pytest.approx(float(last)) != 5.0


def test_a_value_outside_its_range_is_said_and_the_impact_stays(view):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    before = view.settle()
    box = view.control(SPEED).find_element(By.XPATH, "./following::input[@inputmode][1]")
    box.send_keys(Keys.CONTROL, "a")
    box.send_keys("77")
    assert "must be a number from above 0 to 30 m/s" in until(lambda: view.text("[data-problem]"))
    assert "77" in view.text("[data-problem]")
    view.click("Sim")
    duration = view.find("//label[normalize-space(.)='duration [s]']/following::input[1]")
    duration.send_keys(Keys.CONTROL, "a")
    duration.send_keys("long")
    until(lambda: "long" in view.text("[data-problem]"))
    assert view.page.session.slot("A").setup.duration == 0.04
    until(lambda: view.page.session.slot("A").setup.normal_velocity in (5.0, 30.0))
    assert before[1] == peak()


def test_two_setups_side_by_side(view):
    from selenium.webdriver.common.keys import Keys

    view.find("//label[normalize-space(.)='compare A | B']/following::input[1]").click()
    until(lambda: len(view.shown()) == 2)
    for tenths in range(51, 54):
        view.press(view.thumb(SPEED), Keys.ARROW_RIGHT, tenths / 10)
    until(lambda: view.page.session.slot("B").setup.normal_velocity == pytest.approx(5.3))
    a, b = view.settle("A")[1], view.settle("B")[1]
    assert (a, b) == (peak(), peak(normal_velocity=5.3))
    view.click("Criteria")
    row = until(lambda: view.text("[data-row=peak_g]"))
    assert re.split(r"\s+", row)[-6:-3] == [f"{a:.4g}", f"{b:.4g}", f"{100 * (b - a) / a:+.1f}"]


def test_what_a_user_has_just_chosen_is_not_overwritten_while_another_change_is_worked_on(view):
    with view.page._lock:  # as long as a change of another value is worked on
        view.choose("rig", "headform")
        until(lambda: view.page._turn.content("impact.rig") == "headform")
        view.page.session.change("A", "impact.friction", 0.3)
        view.page._told("impact.friction")
    until(lambda: view.page.session.slot("A").setup.rig == "headform")
    assert view.page._turn.content("impact.rig") == "headform"
    assert view.settle()[1] == peak(rig="headform", friction=0.3)


def test_presets_foam_and_its_crush_map(view):
    view.click("Presets")
    view.choose("scenario", "oblique_table1")
    until(lambda: view.page.session.slot("A").setup.tangential_velocity == 5.0)
    view.settle()
    view.page.session.load("A", {"helmet.coupling": "foam"})
    expected = simulate(ImpactSetup(overrides={"helmet.coupling": "foam"}))
    assert view.settle()[1] == evaluate(expected).peak_g.value
    worst = 1e3 * expected.extras["residual_crush"].max()
    said = until(lambda: view.text(".hs-two")).replace("\N{NO-BREAK SPACE}", " ")
    assert f"at most {worst:.1f} mm" in said


def test_the_replay_follows_its_slider_and_plays(view):
    from selenium.webdriver.common.keys import Keys

    record = simulate(ImpactSetup())
    at_peak = round(evaluate(record).peak_g.time / record.time_step)
    view.click("to the peak")
    until(lambda: f"{0.05 * at_peak:.2f} ms" in view.text("[data-now]"))
    for step in range(1, 5):
        view.press(view.thumb("time [ms]"), Keys.ARROW_RIGHT, 0.05 * (at_peak + step))
    now = f"{0.05 * (at_peak + 4):.2f} ms"
    until(lambda: now in view.text("[data-now]"))
    force = record.ground_force[at_peak + 4, 2] / 1e3
    assert f"{force:.2f} kN" in view.text("[data-now]")
    view.click("play")
    until(lambda: now not in view.text("[data-now]"))
    view.click("pause")
    until(lambda: not view.page._replay._playing.is_set())


def test_texts_to_copy_are_those_of_the_setup(view):
    view.page._load({"impact.friction": 0.7})
    view.click("Export")
    texts = until(lambda: view.text("[data-copy]"))
    assert "helmet-sim run single -o impact.friction=0.7" in texts
    assert "impact.friction: 0.7" in texts and "friction=0.7" in texts


def test_a_log_is_opened_and_stepped_through_and_a_bad_one_is_said(view, tmp_path):
    pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")
    from logs import write_log

    path = tmp_path / "two.mcap"
    setups = [ImpactSetup(normal_velocity=v, duration=0.02) for v in (3.0, 4.0)]
    write_log(path, setups)
    view.click("Log")
    field = view.find("//label[normalize-space(.)='file (.mcap)']/following::input[1]")
    field.send_keys(str(tmp_path / "none.mcap"))
    until(lambda: view.page.log._path.value.endswith("none.mcap"))
    view.click("Open")
    assert "none.mcap" in until(lambda: view.text("[data-problem]"))
    view.page.log.open(str(path))
    assert view.settle()[1] == evaluate(simulate(setups[0])).peak_g.value
    assert "two.mcap, impact 1 of 2" in view.text("[data-digest]")
    view.click("next")
    until(lambda: "impact 2 of 2" in view.text("[data-digest]"))
    assert view.settle()[1] == evaluate(simulate(setups[1])).peak_g.value


# the command


def occupied() -> socket.socket:
    """A port that somebody listens at, with a free one after it."""
    for port in range(8600, 8900, 2):
        if free_port(port) == port and free_port(port + 1) == port + 1:
            taken = socket.socket()
            taken.bind(("127.0.0.1", port))
            taken.listen()
            return taken
    raise AssertionError("no free port")


def test_a_port_in_use_is_said_and_the_next_one_taken_on_this_host_only():
    with occupied() as taken:
        port = taken.getsockname()[1]
        command = [sys.executable, "-m", "helmet_sim_ros", "explore", "--no-browser",
                   "--port", str(port)]  # fmt: skip
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            lines = [process.stdout.readline(), process.stdout.readline()]
            assert lines[0] == f"port {port} is in use; taking {port + 1}\n"
            assert lines[1].startswith(f"http://127.0.0.1:{port + 1} ")
            with urllib.request.urlopen(f"http://127.0.0.1:{port + 1}", timeout=PATIENCE) as page:
                assert page.status == 200 and b"<html" in page.read()
            with socket.socket() as other, pytest.raises(OSError):
                other.connect(("127.0.0.2", port + 1))  # a server for everybody would answer
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()
            process.wait()


def test_no_port_left_is_said():
    with socket.socket() as last:
        last.bind(("127.0.0.1", 65535))
        with pytest.raises(HelmetSimError, match="no free port from 65535"):
            free_port(65535)


def test_the_page_is_not_shared_with_the_outside(server):
    assert server.request_share_url() is None
    assert server.get_host() == "127.0.0.1"


def test_a_missing_extra_names_what_brings_it():
    code = (
        "import sys; sys.modules['viser'] = None\n"
        "from helmet_sim_ros.cli import main\n"
        "main(['explore', '--no-browser'])\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 1 and "pip install 'helmet_sim_ros[explore]'" in run.stderr
    assert "Traceback" not in run.stderr


def test_a_scenario_file_that_cannot_be_read_is_said_on_the_page(server, tmp_path):
    page = Page(server, [str(tmp_path / "none.yaml")])
    assert "none.yaml" in page.session.refusal and page.problems
    page.close()
