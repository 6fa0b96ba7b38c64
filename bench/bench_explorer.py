"""How fast the explorer answers on this machine, and its picture.

    python bench/bench_explorer.py                                       # times
    python bench/bench_explorer.py --picture docs/figures/explorer.png   # and the figure

Prints the time from the command to the page served (machine code already compiled), the time from
a change of a value to everything queued for the browser (median and largest of 30; and the
processor's time, which is what it takes on a core that has nothing else to do), and, where
chromium and selenium are installed, the time from a key on a slider to the new results on the page
of a headless browser, which draws without a graphics card.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import time
import urllib.request
from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from helmet_sim_ros.explore.page import Page
from helmet_sim_ros.explore.server import address, free_port, start_server

PATIENCE = 120.0
#: What is varied: name of the value, first value, step.
SWEEPS = (
    ("impact.normal_velocity", 4.0, 0.1, {}),
    ("rider.mass", 60.0, 0.5, {}),
    ("helmet.liner.density", 40.0, 0.5, {"helmet.coupling": "foam"}),
)
#: Waits in the page until the results of another impact stand there; milliseconds since the key.
WAIT_FOR_RESULT = """
const done = arguments[0], began = performance.now();
const name = () => document.querySelector('[data-digest]').dataset.digest, old = name();
const look = () => name() !== old ? done(performance.now() - began) : setTimeout(look, 2);
look();
"""


def start_time() -> float:
    """Seconds from the command to the page served."""
    port = free_port(8700)
    command = [sys.executable, "-m", "helmet_sim_ros", "explore", "--no-browser", f"--port={port}"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0]
        with urllib.request.urlopen(url, timeout=PATIENCE) as page:
            page.read()
        return time.perf_counter() - began
    finally:
        process.terminate()
        process.wait()


def answer_times(
    page: Page, name: str, first: float, step: float
) -> tuple[list[float], list[float]]:
    """Seconds from a change to all that follows queued for the browser: clock, and processor."""
    times, worked = [], []
    for number in range(31):
        began, before = time.perf_counter(), time.process_time()
        page.session.change("A", name, first + number * step)
        page.session.wait_idle(PATIENCE)
        times.append(time.perf_counter() - began)
        worked.append(time.process_time() - before)
    return times[1:], worked[1:]


@contextmanager
def headless(width: int, height: int) -> Iterator[Any]:
    """A browser without a screen."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or "chromium"
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
                     "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
                     f"--window-size={width},{height}"):  # fmt: skip
        options.add_argument(argument)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.set_script_timeout(PATIENCE)
    try:
        yield driver
    finally:
        driver.quit()


def opened(driver: Any, url: str) -> float:
    """Open the page; seconds until its first impact stands there."""
    began = time.perf_counter()
    driver.get(url)
    while not driver.execute_script("return document.querySelector('[data-digest]') !== null"):
        time.sleep(0.02)  # fine enough for seconds; the page tells of nothing by itself
    return time.perf_counter() - began


def key_times(driver: Any) -> list[float]:
    """Seconds from a key on the slider of the normal velocity to new results."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    label = driver.find_element(By.XPATH, "//label[normalize-space(.)='normal velocity [m/s]']")
    slider = driver.find_element(By.ID, label.get_attribute("for"))
    thumb = slider.find_element(By.CSS_SELECTOR, "[role=slider]")
    times = []
    for _ in range(15):
        thumb.send_keys(Keys.ARROW_RIGHT)
        times.append(driver.execute_async_script(WAIT_FOR_RESULT) / 1e3)
        time.sleep(0.5)  # as a hand pauses: what is timed is one key, not the queue of several
    return times[2:]


def picture(page: Page, url: str, path: Path) -> None:
    """Two setups of a foam helmet side by side."""
    from selenium.common.exceptions import TimeoutException

    page._load({"helmet.coupling": "foam"})
    page.session.wait_idle(PATIENCE)
    page._compare.value = True
    page.session.change("B", "impact.normal_velocity", 7.0)
    page.session.wait_idle(PATIENCE)
    page._told()
    with headless(1500, 960) as driver:
        opened(driver, url)
        time.sleep(10.0)  # until everything is drawn, of which the browser tells no end
        driver.execute_script(
            "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
        )
        for attempt in range(10):
            time.sleep(3.0)  # the browser refuses pictures while it draws, and tells of no end
            try:
                driver.save_screenshot(str(path))
                return
            except TimeoutException:  # a loaded machine draws for longer than the driver waits
                print(f"the browser is still drawing ({attempt + 1})", file=sys.stderr)
    raise SystemExit("no picture: the browser does not come to an end of drawing")


def main() -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path)
    chosen = parser.parse_args()
    print(f"command to page served: {start_time():.2f} s")
    server = start_server(8800)
    page = Page(server)
    page.start()
    page.session.wait_idle(PATIENCE)
    for name, first, step, before in SWEEPS:
        page.session.load("A", before)
        times, worked = answer_times(page, name, first, step)
        median, cost = statistics.median(times), statistics.median(worked)
        print(
            f"{name}: {1e3 * median:.0f} ms, at most {1e3 * max(times):.0f} ms, "
            f"of which the processor {1e3 * cost:.0f} ms"
        )
    if shutil.which("chromium") and shutil.which("chromedriver"):
        page.session.load("A", {})
        with headless(1000, 700) as driver:
            print(f"browser, page to first impact: {opened(driver, address(server)):.2f} s")
            times = key_times(driver)
            median = statistics.median(times)
            print(f"browser, key to results: {1e3 * median:.0f} ms, at most {1e3 * max(times):.0f}")
        if chosen.picture:
            picture(page, address(server), chosen.picture)
    page.close()
    server.stop()


if __name__ == "__main__":
    main()
