"""Time to open a large log and to read one impact of it: python bench/bench_log.py [GIGABYTE]

The log is made of six simulated impacts, with every message that the recorder writes, repeated
under new names. Making it takes about a minute and a half per gigabyte.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path

from helmet_sim_ros import open_log
from helmet_sim_ros.mcap_log.layout import IMPACT
from helmet_sim_ros.mcap_log.source import McapSource
from helmet_sim_ros.mcap_log.writer import LogWriter
from helmet_sim_ros.study import load_scenario

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))

from logs import write_log

SPACING = 100_000_000  # ns between impacts


def main() -> None:
    size = 1e9 * float(sys.argv[1] if len(sys.argv) > 1 else 1.0)
    with tempfile.TemporaryDirectory() as folder:
        seed, large = Path(folder, "six.mcap"), Path(folder, "large.mcap")
        write_log(seed, load_scenario("oblique_table1").setups)
        repeat(seed, large, size)
        opening: list[float] = []
        reading: list[float] = []
        for _ in range(5):
            began = time.perf_counter()
            log = open_log(large)
            opening.append(time.perf_counter() - began)
            for k in range(0, len(log), max(1, len(log) // 10)):
                began = time.perf_counter()
                log[k].record  # noqa: B018
                reading.append(time.perf_counter() - began)
        print(f"{large.stat().st_size / 1e9:.2f} GB, {len(log)} impacts")
        for what, times in (("open", opening), ("read one impact", reading)):
            median, worst = statistics.median(times), max(times)
            print(f"{what}: median {median:.3f} s, worst {worst:.3f} s, the first {times[0]:.3f} s")


def repeat(seed: Path, target: Path, size: float) -> None:
    """Write the impacts of a log again and again, each under a new name and at a new time."""
    source = McapSource(seed)
    writer = LogWriter(target)
    topics = {}
    for number, channel in source.channels.items():
        topics[number] = channel.topic
        schema = source.schemas[channel.schema_id].name
        writer.add_channel(channel.topic, schema, channel.metadata["offered_qos_profiles"])
    run, *notes = source.metadata_index
    writer.add_metadata(run.name, source.metadata(run))
    begins = [0, *(note.offset for note in notes)]
    messages = [
        list(source.messages(topics, begin, note.offset))
        for begin, note in zip(begins, notes, strict=False)
    ]
    count = 0
    while writer.size < size:
        for note, own in zip(notes, messages, strict=True):
            old = note.name.removeprefix(IMPACT)
            new = f"{count:0{len(old)}d}"  # as long as the old name, so that lengths stay
            shift = (count + 1) * SPACING - own[0].log_time
            for message in own:
                data = message.data.replace(old.encode(), new.encode())
                writer.write(topics[message.channel], message.log_time + shift, data)
            start = repr((count + 1) * SPACING * 1e-9)
            writer.add_metadata(IMPACT + new, source.metadata(note) | {"start_time": start})
            count += 1
    writer.close()


if __name__ == "__main__":
    main()
