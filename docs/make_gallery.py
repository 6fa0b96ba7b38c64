"""Draw the pictures of docs/gallery.md anew: examples, and the report as a browser shows it.

python docs/make_gallery.py     # needs chromium with chromedriver
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures" / "gallery"
WIDTH = 1240  # pixel


def run(*words: str | Path, folder: Path) -> None:
    """Run a command of this checkout in a folder."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, *words], cwd=folder, env=environment, check=True)


def pictures(page: Path) -> None:
    """Parts of the report of two logs."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ("--headless=new", "--no-sandbox", "--hide-scrollbars", "--disable-gpu",
                     f"--window-size={WIDTH},1000"):  # fmt: skip
        options.add_argument(argument)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    try:
        driver.get(page.as_uri())
        everything = "window.print = () => {}; document.querySelector('[data-act=print]').click()"
        driver.execute_script(everything)
        done = "return document.documentElement.dataset.drawn === 'all'"
        WebDriverWait(driver, 60).until(lambda d: d.execute_script(done))
        save(driver, "report_comparison", "#comparison-3", 1.0)
        save(driver, "report_crush", "#impact-12 .panels", 1.0)
        driver.execute_script("document.querySelector('[data-act=theme]').click()")
        save(driver, "report_dark", "#impact-12", 0.62)
    finally:
        driver.quit()


def save(driver: webdriver.Chrome, name: str, selector: str, share: float) -> None:
    """The upper share of an element as PNG with few colours."""
    (element,) = driver.find_elements("css selector", selector)
    driver.execute_script("arguments[0].scrollIntoView()", element)
    height = int(element.size["height"]) + 50
    driver.set_window_size(WIDTH, max(1000, height + 200))
    image = Image.open(BytesIO(element.screenshot_as_png)).convert("RGB")
    image = image.crop((0, 0, image.width, round(share * image.height)))
    image.quantize(256).save(FIGURES / f"{name}.png", optimize=True)


def main() -> None:
    """Draw everything."""
    FIGURES.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as name:
        folder = Path(name)
        for example in ("first_impact", "liner_study"):
            run(ROOT / "examples" / f"{example}.py", folder=folder)
            shutil.copy(folder / f"{example}.png", FIGURES)
        command = ("-m", "helmet_sim_ros")
        for log, option in (("spring", "helmet.coupling=spring"), ("foam", "helmet.coupling=foam")):
            run(*command, "run", "oblique_table1", "--output", log, "-o", option, folder=folder)
            (made,) = (folder / log).glob("*.mcap")
            made.rename(folder / f"{log}.mcap")
        run(*command, "report", "spring.mcap", "foam.mcap", "-o", "page.html", folder=folder)
        pictures(folder / "page.html")


if __name__ == "__main__":
    main()
