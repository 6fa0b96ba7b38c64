"""The HTML report: contents, and behaviour in a real headless browser."""

from __future__ import annotations

import base64
import json
import re
import shutil
from html.parser import HTMLParser

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")
pytest.importorskip("jinja2", reason="reports need the extra 'report'")

from click.testing import CliRunner
from logs import write_log

from helmet_sim_ros import ImpactSetup, open_log
from helmet_sim_ros.biomech.pulse import magnitude
from helmet_sim_ros.cli import main
from helmet_sim_ros.report.page.page import _script_json, report_page
from helmet_sim_ros.report.page.svg import ticks
from helmet_sim_ros.study import load_reference, load_scenario

BROWSERS = map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
CHROMIUM = next(filter(None, BROWSERS), None)
DRIVER = shutil.which("chromedriver")


class Page(HTMLParser):
    """Tags, text and references of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.texts.append(data.strip())


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """The log of Table 1, and its report by the command line."""
    path = tmp_path_factory.mktemp("report") / "table1.mcap"
    write_log(path, load_scenario("oblique_table1").setups)
    answer = CliRunner().invoke(main, ["report", str(path)])
    assert answer.exit_code == 0, answer.output
    return path, path.with_suffix(".html")


def embedded(html: str) -> list[dict]:
    found = re.findall(r'<script type="application/json" id="data-\d+">(.*?)</script>', html, re.S)
    return [json.loads(text) for text in found]


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4")


def test_it_is_one_file_without_any_request(six):
    _, file = six
    assert file.stat().st_size < 5_000_000
    page = Page(file.read_text(encoding="utf-8"))
    for tag, attributes in page.tags:
        for name in ("src", "href", "action", "data", "srcset", "poster"):
            reference = attributes.get(name) or "#"
            assert reference.startswith(("#", "data:")), (tag, reference)
    policy = [a for tag, a in page.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy[0]["content"]
    assert "url(" not in file.read_text(encoding="utf-8").split("</style>")[0]


def test_the_table_has_the_papers_columns_and_our_numbers(six):
    path, file = six
    page = Page(file.read_text(encoding="utf-8"))
    for impact in open_log(path):
        published = load_reference("table1").row(impact.setup)
        assert f"{impact.logged.peak_g.value:.0f}" in page.texts
        assert f"{impact.logged.force_ratio.value:.2f}" in page.texts
        assert {f"{v:g}" for v in published["peak_g"].values()} <= set(page.texts)
        assert {f"{v:.2f}" for v in published["force_ratio"].values()} <= set(page.texts)
        assert impact.model_hash in " ".join(page.texts)
    assert {"MB", "FE", "THUMS"} <= set(page.texts)


def test_histories_peaks_and_window_are_those_of_the_log(six):
    path, file = six
    for data, impact in zip(
        embedded(file.read_text(encoding="utf-8")), open_log(path), strict=True
    ):
        record, result = impact.record, impact.logged
        arrays = {name: unpacked(text) for name, text in data["arrays"].items()}
        assert all(len(values) == len(record) for values in arrays.values())
        g = magnitude(record.head_acceleration) / 9.80665
        drawn = np.sqrt(arrays["ax"] ** 2 + arrays["ay"] ** 2 + arrays["az"] ** 2)
        assert np.allclose(drawn, g, rtol=1e-5, atol=1e-4)
        assert arrays["cfc"].max() == pytest.approx(result.peak_g_cfc1000.value, rel=1e-5)
        assert arrays["fn"].max() * 1e3 == pytest.approx(result.peak_normal_force.value, rel=1e-5)
        assert data["window"] == pytest.approx([1e3 * t for t in result.hic.window])
        mark = data["marks"]["acceleration"][0]
        assert mark["value"] == result.peak_g.value and mark["time"] == 1e3 * result.peak_g.time
        assert data["limits"]["acceleration"][0]["value"] == 275.0
        poses = unpacked(data["replay"]["poses"]).reshape(-1, len(data["replay"]["shapes"]), 7)
        assert np.allclose(np.linalg.norm(poses[:, :, 3:], axis=2), 1.0, atol=1e-5)
        head = [shape["name"] for shape in data["replay"]["shapes"]].index("head")
        assert np.allclose(poses[0, head, :3], record.head_position[0], atol=1e-6)
        assert np.allclose(poses[-1, head, :3], record.head_position[-1], atol=1e-6)


def test_nothing_in_a_log_becomes_markup(tmp_path):
    path = tmp_path / "a.mcap"
    write_log(path, [ImpactSetup(duration=0.01)])
    log = open_log(path)
    impact = log[0]
    evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    impact.impact_id = evil
    impact.setup = {**impact.setup, "helmet.description": evil, "impact.direction": evil}
    html = report_page([log])
    assert "<script>alert" not in html and "<img" not in html
    assert "&lt;script&gt;alert(1)" in html


def test_data_cannot_end_its_script_element():
    text = str(_script_json({"a": "</script><!-- & -->"}))
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"a": "</script><!-- & -->"}


def test_a_long_record_is_thinned_out_and_says_so(tmp_path):
    path = tmp_path / "a.mcap"
    write_log(path, [ImpactSetup(duration=0.25, rig="headform", normal_velocity=3.0)])
    html = report_page([open_log(path)])
    (data,) = embedded(html)
    assert data["count"] == len(unpacked(data["arrays"]["ax"])) == 2501
    assert data["step"] == pytest.approx(0.1) and "one sample in 2 is drawn" in html


def test_several_logs_on_one_page_and_a_bad_one_beside_them(six, tmp_path):
    path, _ = six
    (tmp_path / "bad.mcap").write_text("no log")
    target = tmp_path / "both.html"
    answer = CliRunner().invoke(
        main, ["report", str(tmp_path / "bad.mcap"), str(path), str(path), "-o", str(target)]
    )
    assert answer.exit_code == 2 and "not an MCAP file" in answer.stderr
    assert len(embedded(target.read_text(encoding="utf-8"))) == 12
    answer = CliRunner().invoke(main, ["report", str(path), "-o", "/proc/no/such.html"])
    assert answer.exit_code == 2 and "cannot be written" in answer.stderr


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.0, 10.0, [0, 2, 4, 6, 8, 10]), (-3.1, 9.0, [-2, 0, 2, 4, 6, 8]), (0, 0.011, [0, 0.002])],
)
def test_ticks_are_round_and_inside(low, high, expected):
    found = ticks(low, high)
    assert found[: len(expected)] == pytest.approx(expected)
    assert all(low - 1e-9 <= value <= high + 1e-9 for value in found)


# in a browser


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no chromium with chromedriver on this machine")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                     "--window-size=1200,1600"):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def page(browser, six):
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(six[1].as_uri())
    assert browser.execute_script("return document.documentElement.dataset.ready") == "true"
    return browser


#: How many distinct colours a canvas shows.
COLORS = """
const c = arguments[0], d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
const seen = new Set();
for (let i = 0; i < d.length; i += 4) if (d[i + 3]) seen.add((d[i] << 16) | (d[i+1] << 8) | d[i+2]);
return seen.size;
"""


def css(browser, selector):
    from selenium.webdriver.common.by import By

    return browser.find_elements(By.CSS_SELECTOR, selector)


def test_no_console_error_and_no_request_in_a_browser(page):
    assert [entry for entry in page.get_log("browser") if entry["level"] != "INFO"] == []
    requests = []
    for entry in page.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            requests.append(message["params"]["request"]["url"])
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []


def test_every_plot_and_replay_is_drawn(page):
    plots = css(page, ".chart canvas")
    assert len(plots) == 18
    assert all(page.execute_script(COLORS, plot) > 10 for plot in plots)
    replays = css(page, ".replay canvas")
    assert len(replays) == 6
    assert all(page.execute_script(COLORS, replay) > 10 for replay in replays)
    assert len(css(page, "svg.panel polyline.curve")) == 24


def test_a_click_or_a_key_on_a_legend_hides_and_shows_a_curve(page):
    from selenium.webdriver.common.keys import Keys

    chart = "#impact-1 [data-chart=acceleration] "
    (canvas,) = css(page, chart + "canvas")
    snapshot = "return arguments[0].toDataURL()"
    before = page.execute_script(snapshot, canvas)
    legend = css(page, chart + ".u-legend th")
    resultant = next(item for item in legend if "resultant" in item.text)
    assert resultant.get_attribute("aria-pressed") == "true"
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", resultant)
    resultant.click()
    assert resultant.get_attribute("aria-pressed") == "false"
    hidden = page.execute_script(snapshot, canvas)
    assert hidden != before
    resultant.send_keys(Keys.ENTER)
    assert resultant.get_attribute("aria-pressed") == "true"
    assert page.execute_script(snapshot, canvas) != hidden


def test_plots_and_replay_answer_to_the_keyboard(page):
    from selenium.webdriver.common.keys import Keys

    (plot,) = css(page, "#impact-1 [data-chart=force] .plot")
    (reset,) = css(page, "#impact-1 [data-chart=force] .reset")
    assert not reset.is_displayed()
    plot.send_keys("+", Keys.ARROW_RIGHT)
    assert reset.is_displayed()
    values = css(page, "#impact-1 [data-chart=force] .u-legend .u-value")
    assert re.fullmatch(r"[\d.]+", values[0].text)
    plot.send_keys("0")
    assert not reset.is_displayed()
    (play,) = css(page, "#impact-1 [data-act=play]")
    (text,) = css(page, "#impact-1 [data-act=text]")
    (canvas,) = css(page, "#impact-1 .replay canvas")
    seen = {text.text}
    canvas.send_keys(" ")
    assert play.text == "Pause"
    for _ in range(40):
        seen.add(text.text)
    canvas.send_keys(" ")
    assert play.text == "Play" and len(seen) > 2
    (slider,) = css(page, "#impact-1 [data-act=seek]")
    slider.send_keys(Keys.HOME)
    assert text.text.startswith("0.00 ms")


def test_narrow_dark_and_printed(page):
    device = {"width": 360, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", device)
    try:
        page.refresh()
        wide = page.execute_script("return document.documentElement.scrollWidth")
        assert wide <= 360
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    (canvas,) = css(page, "#impact-1 [data-chart=force] canvas")
    background = "return getComputedStyle(document.body).backgroundColor"
    light = page.execute_script(background), page.execute_script("return arguments[0].toDataURL()",
                                                                 canvas)  # fmt: skip
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    try:
        page.refresh()
        (canvas,) = css(page, "#impact-1 [data-chart=force] canvas")
        assert page.execute_script(background) != light[0]
        assert page.execute_script("return arguments[0].toDataURL()", canvas) != light[1]
        printed = page.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
        pdf = base64.b64decode(printed["data"])
        assert pdf.startswith(b"%PDF") and len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 7
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
