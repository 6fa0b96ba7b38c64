"""Every kind of YAML file that is read, mutated: read as such a file, or refused as one."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros.biomech.standards import load_standard
from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.model.fall.posture import load_posture
from helmet_sim_ros.model.foams import load_foam
from helmet_sim_ros.model.head_surface import load_head_surface
from helmet_sim_ros.model.headform import load_headform
from helmet_sim_ros.model.helmet import load_helmet
from helmet_sim_ros.model.surface.scenes import load_scene, load_surface
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_optimisation, load_scenario, load_study
from helmet_sim_ros.study.certification.protocol import load_protocol
from helmet_sim_ros.study.sweeps.population import load_population
from helmet_sim_ros.study.validation.experiments import load_experiments
from helmet_sim_ros.study.validation.foam import load_foam_reference
from helmet_sim_ros.yaml_file import read_yaml

#: Files of config/ -> what reads them.
READERS: dict[str, Callable[[str], Any]] = {
    "helmets/*": load_helmet,
    "standards/*": load_standard,
    "scenarios/*": load_scenario,
    "studies/*": lambda path: _study(path),
    "protocols/*": load_protocol,
    "populations/*": load_population,
    "foams/*": load_foam,
    "headforms/*": load_headform,
    "head_surfaces/*": load_head_surface,
    "postures/*": load_posture,
    "surfaces/*": load_surface,
    "scenes/*": load_scene,
    "references/experiments_*": load_experiments,
    "references/eps": load_foam_reference,
}
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)
#: What is put in place of a value, or of a whole file.
VALUES = [
    "", "~", "nan", ".nan", ".inf", "-.inf", "1e400", "-1e-400", "0x", "0b_", "1:99:99", "._",
    "9" * 5000, "1_0", "0o17", "yes", "=", "<<", "2001-99-99", "2001-01-01", "'", '"', "&a [*a]",
    "*a", "&a 1", "!!python/object:os.system x", "!!binary ab", "!!int x", "!!float x", "!!set {a}",
    "!!timestamp 2001-13-01", "!<x> y", "{}", "[]", "[1]", "[[[1]]]", "{a: {b: {c: 1}}}", "1j",
    "[" * 50 + "]" * 50, "[" * 20_000 + "]" * 20_000, "{? [a] : b}", "{1: 2}", "{~: 1}", "a" * 300,
    "../../../../etc/passwd", "/etc/passwd", "/dev/zero", "\\x00", "\x07", "\u202ename", "\ud7ff",
    "[" + ", ".join(map(str, range(3000))) + "]", "-0.0", "1e-320", "18446744073709551616", "|",
    ">", "- a", "? ", "%YAML 9.9", "---", "...", "{<<: *a}", "{<<: 3}", "{<<: {a: 1}, a: 2}",
]  # fmt: skip
WHOLE = [
    BOMB, "[" * 20_000, "{a: " * 20_000, "&a [*a]", "- " * 20_000, "a: &a {b: *a}", "",
    "[" + "1," * 200_000 + "]", "x" * 3_000_000, "a: b\n" * 50_000,
    "\n".join(f"k{i}: &k{i} {{<<: *k{i - 1}}}" if i else "k0: &k0 {a: 1}" for i in range(300)),
    "\n".join(f"{' ' * i}a:" for i in range(2000)),
    "cases:\n" + "- {impact.friction: 0.1}\n" * 9000,
]  # fmt: skip


class MutatedYaml(Attack):
    """A mutated file is read, or refused by an error of ours, at once and with little memory."""

    name = "mutated YAML"
    what = "configuration files of every kind with changed text, values, aliases and types"
    cases = (1000, 10_000)

    def prepare(self, folder: Path) -> None:
        config = share_directory() / "config"
        self._files = {kind: sorted(config.glob(f"{kind}.yaml")) for kind in READERS}
        self._texts = [path.read_text() for paths in self._files.values() for path in paths]
        self._place = folder / "mutated.yaml"
        for kind, paths in self._files.items():  # what is not mutated can be read
            for path in paths:
                READERS[kind](str(path))

    def case(self, rng: random.Random) -> Outcome:
        kind = rng.choice(list(READERS))
        path = rng.choice(self._files[kind])
        text = self._mutated(path.read_text(), rng)
        self._place.write_bytes(text.encode("utf-8", "surrogateescape"))
        what = f"{path.parent.name}/{path.name}"
        try:
            READERS[kind](str(self._place))
        except HelmetSimError as error:
            message = str(error)
            if "root:" in message:
                return Outcome("lost", f"{what}: quotes another file: {message}")
            if not message.isprintable() or len(message) > 20_000:
                return Outcome("lost", f"{what}: a message that cannot be shown: {message[:200]!r}")
            return Outcome("refused", f"{what}: {message}")
        return Outcome("held", what)

    def _mutated(self, text: str, rng: random.Random) -> str:
        if rng.random() < 0.05:
            return rng.choice(WHOLE)
        for _ in range(rng.choice([1, 1, 2, 5])):
            text = rng.choice(MUTATIONS)(text, rng)
        if rng.random() < 0.05:
            other = rng.choice(self._texts)
            text = text[: rng.randrange(len(text) + 1)] + other[rng.randrange(len(other)) :]
        return text


def _other_value(text: str, rng: random.Random) -> str:
    places = list(re.finditer(r"(?<=[:\-,\[] )[^\s,\]}#][^,\]}#\n]*", text))
    if not places:
        return text
    place = rng.choice(places)
    return text[: place.start()] + rng.choice(VALUES) + text[place.end() :]


def _other_number(text: str, rng: random.Random) -> str:
    places = list(re.finditer(r"-?\d+\.?\d*(?:[eE][-+]?\d+)?", text))
    if not places:
        return text
    place = rng.choice(places)
    number = repr(float(place[0]) * rng.choice([-1.0, 0.0, 1e3, 1e-3, 1e30, 1e300, 1.01]))
    return text[: place.start()] + number + text[place.end() :]


def _other_character(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text) + 1)
    odd = ":-[]{},&*!|>'\"%@`#?\t\n \0\x85\ufeff\udcff"
    new = rng.choice([*odd, chr(rng.randrange(128))])
    return text[:at] + new + text[at + rng.randrange(2) :]


def _other_line(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    i = rng.randrange(len(lines))
    how = rng.randrange(5)
    if how == 0:
        del lines[i]
    elif how == 1:
        lines.insert(i, lines[i])
    elif how == 2:
        lines[i] = " " * rng.randrange(1, 60) + lines[i]
    elif how == 3:
        lines[i] = lines[i].lstrip()
    else:
        lines.insert(rng.randrange(len(lines) + 1), lines.pop(i))
    return "\n".join(lines)


def _other_key(text: str, rng: random.Random) -> str:
    places = list(re.finditer(r"[\w.]+(?=:)", text))
    if not places:
        return text
    place = rng.choice(places)
    keys = [
        "x",
        "",
        "__class__",
        "impact.friction",
        "helmet",
        "~",
        "1",
        "<<",
        place[0] * 2,
        "'\\n'",
    ]
    return text[: place.start()] + rng.choice(keys) + text[place.end() :]


def _cut(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text) + 1)]


MUTATIONS = [_other_value, _other_value, _other_number, _other_character, _other_line, _other_key,
             _cut]  # fmt: skip


def _study(path: str) -> object:
    data = read_yaml(Path(path), "study")
    wanted = isinstance(data, dict) and "variables" in data
    return (load_optimisation if wanted else load_study)(path)
