"""Logs whose names and texts are markup, paths and control characters, through every verb."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros import Evaluation, ImpactRecord, ImpactSetup, evaluate
from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.mcap_log.blocks import Block
from helmet_sim_ros.mcap_log.layout import CRITERIA_TYPE, IMPACT, RUN, SAMPLES_TYPE
from helmet_sim_ros.mcap_log.writer import LogWriter

ROOT = Path(__file__).resolve().parents[2]
#: A tag, attribute or function of this name in a page was put there by a log.
MARK = "xss9"
NAMES = [
    f"<{MARK}>", f"</script><{MARK}>", f'"><{MARK}>', f"' {MARK}='1", f"<img src=x {MARK}=1>",
    f"</style></title><{MARK}>", f"<!--{MARK}", f"-->]]><{MARK}>", "javascript:alert(1)",
    "&lt;b&gt;", "../../outside", "../outside/x", "/outside", "..", ".", "", "a/b", "a\\b", "C:\\x",
    "~", "$HOME", "`id`", "$(id)", ";id", "-rf", "--help", "con", "a" * 200, "a" * 300, "é" * 100,
    "\u202ename", "a\nb", "a\rb", "a\tb", "\x1b[2J", "\x1b]0;x\x07", "\x00", "\x7f", "\x9b2J",
    "\u200b", "\ufeff", "[bold]x[/bold]", "[link=http://x]y", "[/]", "%s", "{0}", "{{x}}", "{%x%}",
    "=1+1", "\u2028", "{'a': 1}", "null", "true", "1", "nan",
]  # fmt: skip
VERBS = [
    ["review"], ["review", "--json"], ["report"], ["recover"], ["figures"],
    ["export", "-f", "csv"], ["export", "-f", "isomme"], ["export", "-f", "parquet"],
    ["replay", "--size", "64x64", "--rate", "5", "--slow", "1000"],
]  # fmt: skip


class HostileNames(Attack):
    """No name in a log leaves its folder, becomes markup, or moves the cursor of a terminal."""

    name = "hostile names"
    what = "ids, scenarios, setups and notes that are markup, paths, control characters"
    cases = (60, 1000)
    bounded = False  # a video takes longer

    def prepare(self, folder: Path) -> None:
        sys.path.insert(0, str(ROOT / "test"))
        from logs import simulated

        self._folder = folder
        setup = ImpactSetup(duration=0.002, time_step=1e-4, normal_velocity=5.0)
        self._impact, self._record = simulated(setup)
        self._verdict = evaluate(self._record)

    def case(self, rng: random.Random) -> Outcome:
        shutil.rmtree(self._folder)
        inside = self._folder / "inside"
        inside.mkdir(parents=True)
        texts: dict[str, str] = {}

        def text(what: str, usual: str, often: float = 0.4) -> str:
            texts[what] = rng.choice(NAMES) if rng.random() < often else usual
            return texts[what]

        try:
            path = _forged(inside / "log.mcap", self._record, self._verdict, text)
        except (HelmetSimError, UnicodeEncodeError) as error:  # the format has UTF-8 only
            return Outcome("refused", f"{texts}: cannot be written: {error}")
        verb = rng.choice(VERBS)
        if verb == ["recover"]:
            path = path.rename(inside / "log.mcap.part")
            path.write_bytes(path.read_bytes()[:-40])
        outcome = self._used(path, verb)
        odd = {what: value for what, value in texts.items() if value in NAMES}
        return Outcome(outcome.verdict, f"{' '.join(verb)}, {odd}: {outcome.detail}")

    def _used(self, path: Path, verb: list[str]) -> Outcome:
        from click.testing import CliRunner

        from helmet_sim_ros.cli import main

        if verb[0] == "replay":  # OpenGL wants a process of its own
            done = subprocess.run(
                [sys.executable, "-m", "helmet_sim_ros", *verb, path.name], cwd=path.parent,
                env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            code, output = done.returncode, done.stdout + done.stderr
        else:
            here = Path.cwd()
            os.chdir(path.parent)
            try:
                answer = CliRunner().invoke(main, [*verb, path.name])
            finally:
                os.chdir(here)
            if answer.exception is not None and not isinstance(answer.exception, SystemExit):
                raise answer.exception
            code, output = answer.exit_code, answer.output
        if code not in (0, 1, 2) or "Traceback" in output:
            return Outcome("failed", f"exit code {code}: {output}")
        shown = output.replace("\n", "")
        if "--json" in verb:
            shown = shown.replace("\x7f", "")  # JSON need not escape it; it moves nothing
        if not shown.isprintable():
            odd = sorted({c for c in shown if not c.isprintable()})
            return Outcome("lost", f"prints {odd!r}")
        left = [p.name for p in self._folder.iterdir() if p.name != "inside"]
        if left or Path("/outside").exists():
            return Outcome("lost", f"wrote {left} outside")
        for page in path.parent.rglob("*.html"):
            marks = Marks()
            marks.feed(page.read_text(encoding="utf-8"))
            if marks.found:
                return Outcome("lost", f"{page.name} has {marks.found} of a log in it")
        return Outcome("refused" if code == 2 else "held", output[-300:])


class Marks(HTMLParser):
    """Finds tags and attributes that a log has brought into a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [name for name in (tag, *(key for key, _ in attrs)) if MARK in name]
        links = [value or "" for key, value in attrs if key in ("href", "src", "action")]
        self.found += [link for link in links if link.lower().strip().startswith("javascript:")]


def _forged(
    path: Path, record: ImpactRecord, verdict: Evaluation, text: Callable[..., str]
) -> Path:
    """A log that is whole and sealed, with texts from ``text(what, usual)`` in it."""
    from rclpy.serialization import serialize_message

    from helmet_sim_ros.biomech.record import block_labels, to_block
    from helmet_sim_ros.nodes import samples
    from helmet_sim_ros.nodes.diagnostics import from_evaluation

    writer = LogWriter(path, text("library", "helmet_sim_ros"))
    writer.add_channel("/impact/samples", SAMPLES_TYPE, "[]")
    writer.add_channel("/evaluation/criteria", CRITERIA_TYPE, "[]")
    writer.add_metadata(
        RUN,
        {
            "format": "2", "scenario": text("scenario", "test"),
            "started": text("started", "2026-01-01T00:00:00+00:00"),
            text("key", "python"): text("value", "3.11"), "version.numpy": text("version", "2.0"),
        },
    )  # fmt: skip
    writer.attach(text("attachment", "scenario.yaml"), "text/plain", text("file", "cases: []"), 0)
    setup = dict(record.setup)
    for key in ("helmet.name", "helmet.description", "impact.direction", "impact.rig"):
        setup[key] = text(key, str(setup.get(key, "")), 0.2)
    if (key := text("setup key", "", 0.1)) != "":
        setup[key] = text("setup value", "0.4")
    data = to_block(record)
    name = text("id", "i0", 0.6)
    block = Block(
        name, 0, len(data), 1.0, tuple(block_labels(record.joint_names)), data, setup=setup,
        model=text("model", "<mujoco/>"), extras={"notes": [text("note", "hand first")]},
    )  # fmt: skip
    writer.write("/impact/samples", 10**9, serialize_message(samples.to_message(block)))
    notes = {"start_time": "1.0", "samples": str(len(data)), "complete": "true", "problem": "",
             "setup": json.dumps(setup)}  # fmt: skip
    writer.add_metadata(IMPACT + name, notes)
    peak = verdict.criteria["peak_g"]._replace(note=text("criterion note", ""))
    mine = peak._replace(name=text("criterion", "mine"))
    forged = replace(
        verdict,
        title=text("title", "t"),
        criteria={**verdict.criteria, "peak_g": peak, mine.name: mine},
        messages=(text("message", "m"),),
        warnings=(text("warning", "w"),),
    )
    message = from_evaluation(forged, name, 10**9)
    writer.write("/evaluation/criteria", 10**9, serialize_message(message))
    if text("lost half", "") != "":  # a second impact that is not complete
        bad = {"start_time": "2.0", "samples": "5", "complete": "false",
               "problem": text("problem", "incomplete", 1.0)}  # fmt: skip
        writer.add_metadata(IMPACT + "bad", bad)
    return writer.close()
