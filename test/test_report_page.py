"""The HTML report: contents, and behaviour in a real headless browser."""

from __future__ import annotations

import base64
import json
import os
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
from helmet_sim_ros.report.page.blocks import LEVELS, packed, unpacked
from helmet_sim_ros.report.page.comparison import log_names
from helmet_sim_ros.report.page.crush import color, crush_map
from helmet_sim_ros.report.page.page import report_page
from helmet_sim_ros.report.page.quantity import number, pretty, quantity
from helmet_sim_ros.report.page.svg import Curve, panel, ticks
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


def embedded(html: str) -> list[tuple[dict, dict[str, np.ndarray]]]:
    """Plain data and arrays of every impact of a page."""
    articles = html.partition('<section id="impacts">')[2]
    found = re.findall(r"<script type=\"text/plain\" data-block>(.*?)</script>", articles, re.S)
    return [unpacked(text) for text in found]


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


def test_a_bar_shows_the_share_of_the_limit_that_is_used(six):
    path, file = six
    bars = re.findall(r'class="bar"><span style="width: (\d+)%"', file.read_text(encoding="utf-8"))
    used = [impact.logged.criteria[n].value / limit for impact in open_log(path)
            for n, limit in (("peak_g", 275.0), ("hic", 2400.0))]  # fmt: skip
    assert [int(bar) for bar in bars] == [round(100.0 * min(1.0, share)) for share in used]


def test_histories_peaks_and_window_are_those_of_the_log(six):
    path, file = six
    for (data, arrays), impact in zip(
        embedded(file.read_text(encoding="utf-8")), open_log(path), strict=True
    ):
        record, result = impact.record, impact.logged
        assert data["count"] == len(arrays["ax"]) == len(record)
        g = magnitude(record.head_acceleration) / 9.80665
        drawn = np.sqrt(arrays["ax"] ** 2 + arrays["ay"] ** 2 + arrays["az"] ** 2)
        assert np.allclose(drawn, g, atol=1e-4 * g.max())
        spin = np.sqrt(arrays["sx"] ** 2 + arrays["sy"] ** 2 + arrays["sz"] ** 2)
        assert spin.max() * 1e3 == pytest.approx(result.peak_angular_acceleration.value, rel=1e-4)
        rate = np.sqrt(arrays["wx"] ** 2 + arrays["wy"] ** 2 + arrays["wz"] ** 2)
        assert rate.max() == pytest.approx(result.peak_angular_velocity.value, rel=1e-4)
        assert arrays["cfc"].max() == pytest.approx(result.peak_g_cfc1000.value, rel=1e-4)
        assert arrays["fn"].max() * 1e3 == pytest.approx(result.peak_normal_force.value, rel=1e-4)
        assert data["window"] == pytest.approx([1e3 * t for t in result.hic.window])
        mark = data["marks"]["acceleration"][0]
        assert mark["value"] == result.peak_g.value and mark["time"] == 1e3 * result.peak_g.time
        assert data["limits"]["acceleration"][0]["value"] == 275.0
        names = [shape["name"] for shape in data["replay"]["shapes"]]
        poses = arrays["replay_poses"].reshape(len(names), 7, -1)
        assert np.allclose(np.linalg.norm(poses[:, 3:], axis=1), 1.0, atol=1e-3)
        head = names.index("head")
        assert np.allclose(poses[head, :3, 0], record.head_position[0], atol=1e-3)
        assert np.allclose(poses[head, :3, -1], record.head_position[-1], atol=1e-3)


def test_what_is_packed_comes_back_up_to_a_step_of_its_range():
    values = {"wave": np.sin(np.arange(500) / 20.0) * 300.0, "flat": np.full(7, -2.5),
              "jump": np.array([0.0, 1e6, -1e6, 0.0]), "none": np.zeros(0)}  # fmt: skip
    plain, arrays = unpacked(packed({"a": "</script><!-- & -->"}, values))
    assert plain == {"a": "</script><!-- & -->"}
    for name, given in values.items():
        step = np.ptp(given) / LEVELS if len(given) else 0.0
        assert np.allclose(arrays[name], given, rtol=0.0, atol=0.51 * step)


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (11487.2, "rad/s^2", "11.49\u00a0krad/s²"), (8883.0, "N", "8.883\u00a0kN"),
        (0.01903, "m", "19.03\u00a0mm"), (127.16, "g", "127.2\u00a0g"), (2400.0, "-", "2400"),
        (0.0, "s", "0\u00a0ms"), (-1.25, "1/m", "−1.25\u00a01/m"),
    ],
)  # fmt: skip
def test_a_quantity_reads_as_in_print(value, unit, shown):
    assert quantity(value, unit) == shown


def test_numbers_have_true_powers_and_no_digits_that_are_not_known():
    assert [number(v) for v in (6.3e-5, 123456.7, 1234.56, 9999.96, 2.5e8, 0.4)] == [
        "6.3·10⁻⁵", "123\u202f500", "1235", "10\u202f000", "2.5·10⁸", "0.4",
    ]  # fmt: skip
    assert pretty("10400 rad/s^2, 55 kg/m^3, m s^-1") == "10400 rad/s², 55 kg/m³, m s⁻¹"


EVIL = "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=2>"


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A page of two logs whose ids, setup values and file names are HTML."""
    folder = tmp_path_factory.mktemp("hostile")
    logs = []
    for name in ("<img src=x onerror=window.hacked=3>", "<b>b"):
        path = folder / f"{name}.mcap"
        write_log(path, [ImpactSetup(duration=0.01)])
        log = open_log(path)
        impact = log[0]
        impact.impact_id = EVIL
        impact.setup = {**impact.setup, "helmet.description": EVIL, "helmet.name": name + EVIL}
        logs.append(log)
    page = folder / "page.html"
    page.write_text(report_page(logs), encoding="utf-8")
    return page


def test_nothing_in_a_log_becomes_markup(hostile):
    html = hostile.read_text(encoding="utf-8")
    assert "<script>window.hacked" not in html and "<img" not in html and "<b>" not in html
    assert "&lt;script&gt;window.hacked" in html and "&lt;img src=x" in html


def test_a_long_record_is_thinned_out_and_says_so(tmp_path):
    path = tmp_path / "a.mcap"
    write_log(path, [ImpactSetup(duration=0.25, rig="headform", normal_velocity=3.0)])
    html = report_page([open_log(path)])
    ((data, arrays),) = embedded(html)
    assert data["count"] == len(arrays["ax"]) <= 2001
    assert data["step"] == pytest.approx(0.15) and "one sample in 3 is drawn" in html


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """The page of a log with 30 impacts."""
    path = tmp_path_factory.mktemp("many") / "many.mcap"
    setups = [ImpactSetup(rig="headform", normal_velocity=2.0 + 0.1 * i, duration=0.01)
              for i in range(30)]  # fmt: skip
    write_log(path, setups)
    page = path.with_suffix(".html")
    page.write_text(report_page([open_log(path)]), encoding="utf-8")
    return page


def test_a_long_run_stays_small(many):
    assert many.stat().st_size < 200_000 + 30 * 30_000


def test_several_logs_on_one_page_and_a_bad_one_beside_them(six, tmp_path):
    path, _ = six
    (tmp_path / "bad.mcap").write_text("no log")
    target = tmp_path / "both.html"
    answer = CliRunner().invoke(
        main, ["report", str(tmp_path / "bad.mcap"), str(path), str(path), "-o", str(target)]
    )
    assert answer.exit_code == 2 and "not an MCAP file" in answer.stderr
    html = target.read_text(encoding="utf-8")
    assert len(embedded(html)) == 12 and html.count('class="comparison"') == 6
    answer = CliRunner().invoke(main, ["report", str(path), "-o", "/proc/no/such.html"])
    assert answer.exit_code == 2 and "cannot be written" in answer.stderr


def test_the_same_blow_in_several_logs_is_laid_over_itself(six, tmp_path):
    path, _ = six
    other = tmp_path / "softer.mcap"
    setups = load_scenario("oblique_table1", overrides={"helmet.spring.side.A": 30000.0}).setups
    write_log(other, setups[4:])
    html = report_page([open_log(path), open_log(other)])
    part = html.partition("in several logs</h2>")[2].partition('<section id="impacts">')[0]
    found = [unpacked(t) for t in re.findall(r"data-block>(.*?)</script>", part, re.S)]
    assert len(found) == 2
    for (plain, arrays), first, second in zip(
        found, list(open_log(path))[4:], open_log(other), strict=True
    ):
        assert plain["names"] == ["table1", "softer"]
        for i, impact in enumerate((first, second)):
            assert arrays[f"a{i}"].max() == pytest.approx(impact.logged.peak_g.value, rel=1e-3)
        change = 100.0 * (second.logged.hic.value / first.logged.hic.value - 1.0)
        assert f"{change:+.1f} %".replace("-", "−") in part
    links = re.findall(r'<a href="#impact-(\d+)">(table1|softer)</a>', part)
    assert links == [("5", "table1"), ("7", "softer"), ("6", "table1"), ("8", "softer")]
    numbers = re.findall(r'id="impact-(\d+)".*?of (table1|softer)\.mcap', html, re.S)
    assert [n for n in numbers if n in links] == sorted(links)


def test_a_blow_against_itself_shows_no_change(six):
    path, _ = six
    html = report_page([open_log(path), open_log(path)])
    cells = re.findall(r'<td class="change">(.*?)</td>', html)
    assert cells and set(cells) <= {"=", ""}


def test_a_curve_stands_at_the_ticks_of_its_values():
    x, y = np.array([0.0, 10.0, 20.0, 30.0]), np.array([0.0, -2.0, 4.0, 6.0])
    text = panel("loop", "d [mm]", "F [kN]", [Curve(x, y, label="measured")])
    columns, rows = {}, {}
    for place, value in re.findall(
        r'<text x="([\d.]+)" y="\d+" text-anchor="middle">(-?[\d.]+)<', text
    ):
        columns[float(value)] = float(place)
    for place, value in re.findall(r'y="([\d.]+)" text-anchor="end">(-?[\d.]+)<', text):
        rows[float(value)] = float(place) - 4.0
    assert {0.0, 10.0, 20.0, 30.0} <= set(columns) and {-2.0, 0.0, 2.0, 4.0, 6.0} <= set(rows)
    steps = [columns[value] - columns[value - 10.0] for value in (10.0, 20.0, 30.0)]
    assert steps == pytest.approx([steps[0]] * 3, abs=0.11) and steps[0] > 50.0
    assert rows[-2.0] - rows[6.0] > 100.0  # upwards
    (points,) = re.findall(r'<polyline class="curve" points="(.*?)"', text)
    drawn = [tuple(map(float, point.split(","))) for point in points.split()]
    assert drawn == [(pytest.approx(columns[a], abs=0.11), pytest.approx(rows[b], abs=0.11))
                     for a, b in zip(x, y, strict=True)]  # fmt: skip
    _, _, width, height = map(float, re.search(r'viewBox="(.*?)"', text)[1].split())
    assert all(0.0 < a < width and 0.0 < b < height for a, b in drawn)
    assert "F [kN] over d [mm]" in text and ">measured<" in text


def test_logs_of_one_name_are_told_apart(tmp_path):
    paths = [tmp_path / "a" / "x.mcap", tmp_path / "b" / "x.mcap"]
    assert log_names(paths) == ["a/x", "b/x"]
    assert log_names([paths[0], paths[0]]) == ["a/x (1)", "a/x (2)"]


def test_a_map_of_crush_has_the_crown_in_the_middle_and_the_left_side_left():
    """Front up, as far from the middle as the angle from the crown; the darkest is the worst."""
    place = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 2, 2], [-1, 0, 0], [0, 0, -1]], float)
    crush = np.array([4.0, 2.0, 1.0, 3.0, 0.0, 4.0]) * 1e-3
    found = crush_map(crush, 0.1 * place)
    assert found["title"].endswith("at most 4\u00a0mm")
    dots = re.findall(r'<circle cx="(\d+)" cy="(\d+)" r="[\d.]+" fill="(.*?)"', found["svg"])
    (cx, cy, worst), (fx, fy, half), (lx, ly, _), (sx, sy, _) = [
        (float(x), float(y), fill) for x, y, fill in dots
    ]
    assert len(dots) == 4  # neither what is not crushed nor what is below
    assert (fx, sy, ly) == (cx, cy, cy) and fy < cy and lx < sx < cx
    assert (cx - lx, 2 * (cx - sx)) == pytest.approx((cy - fy, cy - fy), abs=2.0)
    assert (worst, half) == (color(1.0), color(0.5))
    assert crush_map(crush[:5], place) is None


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
        absent = "no chromium with chromedriver on this machine"
        if os.environ.get("CI") == "true":
            pytest.fail(f"{absent}: apt-get install chromium chromium-driver")
        pytest.skip(absent)
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


def drawn(browser):
    """Wait until everything of the page is drawn."""
    from selenium.webdriver.support.ui import WebDriverWait

    done = "return document.documentElement.dataset.drawn === 'all'"
    WebDriverWait(browser, 60).until(lambda b: b.execute_script(done))
    return browser


@pytest.fixture
def page(browser, six):
    browser.get_log("browser")
    browser.get_log("performance")
    browser.get(six[1].as_uri())
    return drawn(browser)


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
    assert len(plots) == 30
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
    assert re.fullmatch(r"[\d.]+ ms", values[0].text)
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


def test_legends_say_the_peak_and_have_no_empty_entry(page):
    for legend in css(page, "#impact-5 .u-legend"):
        entries = [row.text for row in legend.find_elements("css selector", ".u-series")]
        assert all(re.fullmatch(r"[\w ,]+\s*max −?[\d.]+", text) for text in entries if text), (
            entries
        )
        assert len([text for text in entries if text]) >= 3
    assert not [e for e in css(page, ".u-legend th") if e.text.strip().endswith(":")]


@pytest.mark.parametrize("width", [360, 700, 1240])
def test_cards_keep_number_and_limit_in_one_line_each(page, width):
    device = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", device)
    try:
        broken = page.execute_script("""
            return [...document.querySelectorAll(".tile dd")].filter((dd) =>
              dd.scrollWidth > dd.clientWidth || dd.getClientRects().length > 1 ||
              dd.clientHeight > 2.2 * parseFloat(getComputedStyle(dd).fontSize))
              .map((dd) => dd.innerText);
        """)
        assert broken == []
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_hostile_text_stays_text_in_a_browser(browser, hostile):
    browser.get(hostile.as_uri())
    drawn(browser)
    assert browser.execute_script("return window.hacked") is None
    assert css(browser, "img") == []
    shown = browser.execute_script("return document.body.innerText")
    assert EVIL in shown and "<img src=x onerror=window.hacked=3>" in shown
    legend = [entry.text for entry in css(browser, ".comparison .u-legend th")]
    assert any("<b>b" in text for text in legend)


def test_of_a_long_run_only_what_is_seen_is_drawn_until_it_is_printed(browser, many):
    browser.get(many.as_uri())
    from selenium.webdriver.support.ui import WebDriverWait

    def count(b):
        return len(css(b, "article[data-drawn]"))

    def shown(number):
        return WebDriverWait(browser, 30).until(lambda b: css(b, f"#impact-{number}[data-drawn]"))

    shown(1)
    assert count(browser) < 10
    browser.execute_script("document.querySelector('#impact-28').scrollIntoView()")
    shown(28)
    assert count(browser) < 20
    browser.execute_script("window.print = () => {}")
    browser.execute_script("document.querySelector('[data-act=print]').click()")
    drawn(browser)
    assert count(browser) == 30


def test_a_button_turns_light_into_dark(page):
    background = "return getComputedStyle(document.body).backgroundColor"
    before = page.execute_script(background)
    (button,) = css(page, "[data-act=theme]")
    button.click()
    assert page.execute_script(background) != before
    button.click()
    assert page.execute_script(background) == before


def test_narrow_dark_and_printed(page):
    device = {"width": 360, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", device)
    try:
        page.refresh()
        drawn(page)
        wide = page.execute_script("return document.documentElement.scrollWidth")
        assert wide <= 360
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    page.refresh()
    drawn(page)
    (canvas,) = css(page, "#impact-1 [data-chart=force] canvas")
    background = "return getComputedStyle(document.body).backgroundColor"
    light = page.execute_script(background), page.execute_script("return arguments[0].toDataURL()",
                                                                 canvas)  # fmt: skip
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    try:
        page.refresh()
        drawn(page)
        (canvas,) = css(page, "#impact-1 [data-chart=force] canvas")
        assert page.execute_script(background) != light[0]
        assert page.execute_script("return arguments[0].toDataURL()", canvas) != light[1]
        printed = page.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
        pdf = base64.b64decode(printed["data"])
        assert pdf.startswith(b"%PDF") and len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 7
    finally:
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
