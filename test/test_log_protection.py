"""Every part that a log shows is checked when it is shown; recovery names all that it lost."""

from __future__ import annotations

import json
import resource
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import lz4.frame
import pytest
import zstandard

pytest.importorskip("rclpy", reason="logs for tests are written by the recorder's session")

from logs import FIRST_START, SPACING, add_impact, session, simulated
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from helmet_sim_ros import ImpactSetup, evaluate, open_log
from helmet_sim_ros.biomech.record import same_samples
from helmet_sim_ros.errors import LogError
from helmet_sim_ros.mcap_log.layout import FORMAT_KEY, TYPE_HASHES
from helmet_sim_ros.mcap_log.records import read_chunk, read_record
from helmet_sim_ros.mcap_log.recover import recover
from helmet_sim_ros.mcap_log.schemas import type_hash
from helmet_sim_ros.mcap_log.seal import SEAL, sealed, unsealed

SETUPS = [
    ImpactSetup(duration=0.005, normal_velocity=4.0, tangential_velocity=3.0),
    ImpactSetup(duration=0.004, direction="front", rig="headform"),
]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "two.mcap"
    log, records = session(path, scenario="cases: [] # precious"), []
    for number, setup in enumerate(SETUPS):
        impact, record = simulated(setup)
        add_impact(log, impact, f"i{number}", FIRST_START + number * SPACING)
        records.append(record)
    log.close()
    return path, records


@pytest.fixture
def path(written) -> Path:
    return written[0]


def changed(path: Path, target: Path, old: bytes, new: bytes) -> Path:
    """A copy with the first of some bytes replaced by as many others."""
    data = path.read_bytes()
    assert old in data and len(old) == len(new)
    target.write_bytes(data.replace(old, new, 1))
    return target


def test_a_changed_byte_of_what_is_shown_is_told(path: Path, tmp_path: Path) -> None:
    cases: list[tuple[bytes, bytes, Callable]] = [
        (b'"impact.friction": 0.4', b'"impact.friction": 0.5', lambda log: log[0].setup),
        (b"complete\x04\0\0\0true", b"complete\x04\0\0\0null", len),
        (b"samples\x02\0\0\081", b"samples\x02\0\0\080", len),
        (b"start_time\x03\0\0\x001.1", b"start_time\x03\0\0\x001.3", len),
        (b"version.mujoco", b"version.muJoco", lambda log: log.run),
        (b"sha256", b"sha257", lambda log: log.run),
        (b"# precious", b"# Precious", lambda log: log.attachments),
        (b'<mujoco model="impact">', b'<mujoco model="imbact">', lambda log: log[0].model_problem),
    ]
    for old, new, read in cases:
        file = changed(path, tmp_path / "changed.mcap", old, new)
        try:
            told = str(read(open_log(file)))
        except LogError as error:
            told = str(error)
        assert str(file) in told and ("damaged" in told or "checksum" in told), old


def test_a_changed_index_is_told_on_opening(path: Path, tmp_path: Path) -> None:
    """Another topic, a missing impact, other definitions: all would have been silent."""
    data = path.read_bytes()
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    end = summary.statistics and data.rfind(b"/evaluation/criteria")
    for at in (end, data.rfind(b"impact/i1"), data.rfind(b"float64[]"), len(data) - 12):
        bad = bytearray(data)
        bad[at] ^= 1
        (tmp_path / "bad.mcap").write_bytes(bad)
        with pytest.raises(LogError, match="checksum of its index"):
            open_log(tmp_path / "bad.mcap")
    for at in (len(data) - 20, len(data) - 28):  # where the footer says the index is
        bad = bytearray(data)
        bad[at] ^= 1
        (tmp_path / "bad.mcap").write_bytes(bad)
        with pytest.raises(LogError, match="index"):
            open_log(tmp_path / "bad.mcap")


def test_checksums_that_were_wiped_out_are_told(path: Path, tmp_path: Path) -> None:
    """Zero stands for no checksum in MCAP; in a log that has them it stands for damage."""
    data = path.read_bytes()
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    bad, file = bytearray(data), tmp_path / "bad.mcap"
    for index in summary.attachment_indexes:
        end = index.offset + index.length
        bad[end - 4 : end] = bytes(4)
    for chunk in summary.chunk_indexes:
        begin = chunk.chunk_start_offset + 9 + 24
        bad[begin : begin + 4] = bytes(4)
    file.write_bytes(bad)
    log = open_log(file)
    with pytest.raises(LogError, match="checksum"):
        _ = log.attachments
    with pytest.raises(LogError, match="checksum"):
        _ = log[0].record
    assert "checksum" in log[0].model_problem  # neither of its two copies can be read
    bad = bytearray(data)
    bad[-12:-8] = bytes(4)
    file.write_bytes(bad)
    assert "no checksum covers the index" in open_log(file).warnings[0]


def test_metadata_of_another_impact_is_told(path: Path, tmp_path: Path) -> None:
    """Sealed, but not what the samples say: both records are whole, one is in the wrong place."""

    def change(record):
        if isinstance(record, Metadata) and record.name == "impact/i0":
            setup = json.loads(record.metadata["setup"]) | {"impact.friction": 1.0}
            record.metadata["setup"] = json.dumps(setup)
        return record

    log = open_log(rewritten(path, tmp_path / "a.mcap", change))
    assert log[0].setup["impact.friction"] == 1.0
    with pytest.raises(LogError, match="the setup in the metadata is not that of the samples"):
        _ = log[0].record


def test_a_seal_covers_name_keys_and_values() -> None:
    values = {"a": "1", "b": "2"}
    good = sealed("run", values)
    assert unsealed("run", good) == values == unsealed("run", sealed("run", good))
    wrong = [("impact/x", good), ("run", good | {"a": "3"}), ("run", good | {"c": ""}),
             ("run", {"a": "1", SEAL: good[SEAL]}), ("run", values),
             ("run", {"a1": "", "b": "2", SEAL: good[SEAL]})]  # fmt: skip
    for name, record in wrong:
        with pytest.raises(ValueError, match="seal"):
            unsealed(name, record)


def test_definitions_with_other_fields_are_refused(path: Path, tmp_path: Path) -> None:
    for name, text in TYPE_HASHES.items():
        assert type_hash(name) == text

    def change(record):
        if isinstance(record, Schema) and record.name.endswith("DiagnosticArray"):
            record.data = record.data.replace(b"string hardware_id", b"string hardware_ix")
        return record

    log = open_log(rewritten(path, tmp_path / "a.mcap", change))
    with pytest.raises(LogError, match="DiagnosticArray has other fields"):
        _ = log[0].logged


def rewritten(
    source: Path,
    target: Path,
    change: Callable,
    seal: bool = True,
    compression: CompressionType = CompressionType.ZSTD,
) -> Path:
    """A sound file of the same records, each changed; sealed again, unless it is to be older."""
    with open(source, "rb") as stream, open(target, "wb") as output:
        writer = Writer(output, compression=compression)
        for record in StreamReader(stream).records:
            record = change(record)
            if isinstance(record, Header):
                writer.start(record.profile, record.library)
            elif isinstance(record, Schema) and record.id > len(writer._Writer__schemas):
                writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel) and record.id > len(writer._Writer__channels):
                writer.register_channel(
                    record.topic, record.message_encoding, record.schema_id, record.metadata
                )
            elif isinstance(record, Message):
                writer.add_message(
                    record.channel_id, record.log_time, record.data, record.publish_time
                )
            elif isinstance(record, Attachment):
                writer.flush()
                writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            elif isinstance(record, Metadata):
                writer.flush()
                values = record.metadata
                writer.add_metadata(record.name, sealed(record.name, values) if seal else values)
            elif type(record).__name__ == "DataEnd":
                break
        writer.finish()
    return target


def older(record):
    """As a log of format 1 has it: no seals, no format in the channels."""
    if isinstance(record, Metadata):
        record.metadata = {k: v for k, v in record.metadata.items() if k not in (SEAL, "library")}
        if "format" in record.metadata:
            record.metadata["format"] = "1"
    if isinstance(record, Channel):
        del record.metadata[FORMAT_KEY]
    return record


def test_a_log_of_format_1_opens_and_says_what_is_not_covered(written, tmp_path: Path) -> None:
    path, records = written
    old = rewritten(path, tmp_path / "old.mcap", older, seal=False)
    log = open_log(old)
    assert log.run["format"] == "1"
    (warning,) = log.warnings
    assert "format 1: no checksum covers run, setups and start times" in warning
    for impact, record in zip(log, records, strict=True):
        assert same_samples(impact.record, record) and impact.setup == record.setup
        assert impact.logged == evaluate(record) and not impact.model_problem
    # What is silent when it is shown is told when the samples are read.
    data = old.read_bytes()
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(data.replace(b'"impact.friction": 0.4', b'"impact.friction": 0.5', 1))
    assert open_log(bad)[0].setup["impact.friction"] == 0.5
    with pytest.raises(LogError, match="not that of the samples"):
        _ = open_log(bad)[0].record
    # Other writers leave out the checksums of attachments.
    with open(old, "rb") as stream:
        index = make_reader(stream).get_summary().attachment_indexes[0]
    end = index.offset + index.length
    bad.write_bytes(data[: end - 4] + bytes(4) + data[end:])
    assert open_log(bad).attachment(index.name) == open_log(old).attachment(index.name) != ""
    # Recovery keeps the format: nothing is sealed that could have been changed before.
    with open(old, "rb") as stream:
        notes = [i for i in make_reader(stream).get_summary().metadata_indexes if "i1" in i.name]
    for number, cut in enumerate((len(data) - 100, notes[0].offset)):
        part = tmp_path / f"{number}.mcap.part"
        part.write_bytes(data[:cut])
        saved = open_log(recover(part).path)
        for impact, record in zip(saved, records, strict=True):
            assert same_samples(impact.record, record) and impact.setup == record.setup
        assert any("format 1" in text for text in saved.warnings)


def test_a_log_of_format_2_is_sealed_as_one_of_today(written, tmp_path: Path) -> None:
    def older(record):
        if isinstance(record, Channel):
            record.metadata[FORMAT_KEY] = "2"
        if isinstance(record, Metadata) and record.name == "run":
            record.metadata["format"] = "2"
        return record

    path, records = written
    old = rewritten(path, tmp_path / "old.mcap", older)
    log = open_log(old)
    assert log.run["format"] == "2" and not log.warnings
    bad = changed(
        old, tmp_path / "bad.mcap", b"start_time\x03\0\0\x001.1", b"start_time\x03\0\0\x001.3"
    )
    with pytest.raises(LogError, match="metadata impact/i0: damaged"):
        open_log(bad)
    result = recover(bad, tmp_path / "good.mcap")
    assert any("metadata impact/i0" in text and "damaged" in text for text in result.lost)
    log = open_log(result.path)
    assert [impact.start_time for impact in log] == [FIRST_START, FIRST_START + SPACING]
    for impact, record in zip(log, records, strict=True):
        assert same_samples(impact.record, record)


def test_a_log_of_a_later_format_is_refused_as_such(path: Path, tmp_path: Path) -> None:
    for version in ("4", "999999"):

        def later(record, version=version):
            if isinstance(record, Channel):
                record.metadata[FORMAT_KEY] = version
            return record

        with pytest.raises(LogError, match=f"log format {version}; this program reads up to 3"):
            open_log(rewritten(path, tmp_path / "a.mcap", later, seal=False))
    for text in ("x", "9" * 400, "١"):

        def odd(record, text=text):
            if isinstance(record, Metadata) and record.name == "run":
                record.metadata["format"] = text
            return record

        with pytest.raises(LogError, match="is not a number"):
            open_log(rewritten(path, tmp_path / "a.mcap", odd))


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.NONE])
def test_chunks_of_every_compression_are_read_and_checked(written, tmp_path, compression) -> None:
    path, records = written
    other = rewritten(path, tmp_path / "a.mcap", lambda r: r, compression=compression)
    log = open_log(other)
    assert [same_samples(i.record, r) for i, r in zip(log, records, strict=True)] == [True, True]
    with open(other, "rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[0]
    bad = damaged(other, tmp_path / "bad.mcap", chunk.chunk_start_offset + chunk.chunk_length // 2)
    with pytest.raises(LogError, match=f"chunk at offset {chunk.chunk_start_offset}"):
        _ = open_log(bad)[0].record


@pytest.mark.parametrize("claimed", [1000, 2**26 + 1, 2**40])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_unpacks_to_more_than_it_may_is_refused(claimed, compression) -> None:
    """400 MB of zeros in a few kilobytes or megabytes, under whatever size it claims."""
    if compression == "zstd":
        packer = zstandard.ZstdCompressor().compressobj()
        packed = b"".join(packer.compress(bytes(2**20)) for _ in range(400)) + packer.flush()
    else:
        lz4_packer = lz4.frame.LZ4FrameCompressor()
        packed = lz4_packer.begin()
        packed += b"".join(lz4_packer.compress(bytes(2**20)) for _ in range(400))
        packed += lz4_packer.flush()
    head = struct.pack("<QQQII", 0, 0, claimed, 1, len(compression)) + compression.encode()
    content = head + struct.pack("<Q", len(packed)) + packed
    stream = BytesIO(struct.pack("<BQ", 6, len(content)) + content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(McapError, match="chunk at offset 0 cannot be unpacked"):
        read_chunk(stream, 0)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


# recovery


def spots(path: Path) -> dict[str, int]:
    """An offset inside each thing that a log holds."""
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    found = {f"attachment {i.name}": i.offset + i.length // 2 for i in summary.attachment_indexes}
    found |= {f"metadata {i.name}": i.offset + 60 for i in summary.metadata_indexes}
    criteria = next(c.id for c in summary.channels.values() if "criteria" in c.topic)
    for chunk in summary.chunk_indexes:
        if criteria in chunk.message_index_offsets:
            found[f"criteria {len(found)}"] = chunk.chunk_start_offset + 300
    return found


def damaged(path: Path, target: Path, at: int) -> Path:
    data = bytearray(path.read_bytes())
    data[at] ^= 0xFF
    target.write_bytes(data)
    return target


def test_recovery_names_criteria_that_are_lost(written, tmp_path: Path) -> None:
    path, records = written
    first, second = (at for name, at in spots(path).items() if name.startswith("criteria"))
    for at, impact_id in ((second, "i1"), (first, "i0")):
        target = tmp_path / f"{impact_id}.mcap"
        result = recover(damaged(path, tmp_path / "bad.mcap", at), target)
        (lost,) = [text for text in result.lost if text.startswith("criteria")]
        assert lost.endswith(impact_id)
        log = open_log(target)
        assert log[impact_id].logged is None
        others = {i.impact_id for i in log if i.logged is not None}
        assert impact_id not in others
        assert json.loads(log.metadata["recovered"]["lost"]) == list(result.lost)
        assert any("recovered" in text for text in log.warnings)
    assert records


def test_recovery_makes_good_what_the_samples_hold_and_names_the_rest(written, tmp_path) -> None:
    path, records = written
    for name, at in spots(path).items():
        if name.startswith("criteria"):
            continue
        bad, target = damaged(path, tmp_path / "bad.mcap", at), tmp_path / "good.mcap"
        target.unlink(missing_ok=True)
        result = recover(bad, target)
        log = open_log(target)
        assert result.impacts == len(log) == 2
        for impact, record in zip(log, records, strict=True):
            assert impact.setup == record.setup and same_samples(impact.record, record)
            assert impact.model and not impact.model_problem
            assert impact.logged == evaluate(record)
        assert any(name in text and "damaged" in text for text in result.lost), name
    with pytest.raises(LogError, match="nothing to recover"):
        recover(path, tmp_path / "again.mcap")


def test_damage_that_only_other_programs_would_meet_is_repaired(written, tmp_path) -> None:
    """Our reader needs no message index; MCAP's does."""
    path, records = written
    with open(path, "rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[-1]
    at = chunk.chunk_start_offset + chunk.chunk_length + 9 + 12
    bad = damaged(path, tmp_path / "bad.mcap", at)
    assert len(open_log(bad)) == 2
    result = recover(bad, tmp_path / "good.mcap")
    assert result.lost == ("the checksum over all of the file is wrong",)
    assert all(
        same_samples(i.record, r)
        for i, r in zip(open_log(tmp_path / "good.mcap"), records, strict=True)
    )


def test_the_data_of_a_log_has_the_checksum_that_it_states(path: Path) -> None:
    data = path.read_bytes()
    end = int.from_bytes(data[-28:-20], "little") - 13
    assert int.from_bytes(data[end + 9 : end + 13], "little") == zlib.crc32(data[:end]) != 0


def test_recovery_goes_on_behind_a_record_whose_length_is_damaged(written, tmp_path) -> None:
    """In a log that was never finished too, where no index says what comes next."""
    path, records = written
    with open(path, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    part = tmp_path / "a.mcap.part"
    data = bytearray(path.read_bytes()[: chunks[-1].chunk_start_offset + chunks[-1].chunk_length])
    # the chunk with the criteria of the first impact
    data[chunks[1].chunk_start_offset + 3] ^= 0x40
    part.write_bytes(data)
    result = recover(part)
    log = open_log(result.path)
    assert [impact.impact_id for impact in log] == ["i0", "i1"]
    assert same_samples(log["i1"].record, records[1])


def test_damage_inside_a_record_reaches_to_its_end(path: Path, tmp_path: Path) -> None:
    with open(path, "rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[1]
    offset, length = chunk.chunk_start_offset, chunk.chunk_length
    bad = damaged(path, tmp_path / "bad.mcap", offset + length // 2)
    said = f"chunk: {length} bytes at offset {offset} are damaged"
    assert any(text.startswith(said) for text in recover(bad).lost)


def test_damage_at_the_end_of_the_data_reaches_to_the_end_that_the_index_knows(
    path: Path, tmp_path: Path
) -> None:
    data = bytearray(path.read_bytes())
    end = int.from_bytes(data[-28:-20], "little") - 13
    with open(path, "rb") as stream:
        offset = make_reader(stream).get_summary().chunk_indexes[-1].chunk_start_offset
    data[offset + 3] ^= 0x40  # its length; nothing behind it looks like the begin of a record
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(data)
    said = f"chunk: {end - offset} bytes at offset {offset} are damaged"
    assert any(text.startswith(said) for text in recover(bad).lost)


def test_recovery_reads_what_a_damaged_message_index_would_reach_over(written, tmp_path) -> None:
    """A message index has no checksum; its length must not hide the chunk behind it."""
    path, records = written
    with open(path, "rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    data = bytearray(path.read_bytes()[: chunks[-1].chunk_start_offset + chunks[-1].chunk_length])
    index = chunks[0].chunk_start_offset + chunks[0].chunk_length
    length = int.from_bytes(data[index + 1 : index + 9], "little")
    over = chunks[1].chunk_start_offset + chunks[1].chunk_length - index - 9
    assert data[index] == 7 and over > length
    data[index + 1 : index + 9] = over.to_bytes(8, "little")
    part = tmp_path / "a.mcap.part"
    part.write_bytes(data)
    result = recover(part)
    log = open_log(result.path)
    assert [impact.logged for impact in log] == [evaluate(record) for record in records]
    assert any(f"at offset {index} are damaged" in text for text in result.lost)


def test_a_record_is_read_only_where_it_is_what_the_index_says() -> None:
    record = bytes([Opcode.CHUNK]) + (3).to_bytes(8, "little") + b"abc"
    stream = BytesIO(b"before" + record)
    assert read_record(stream, 6, Opcode.CHUNK) == b"abc"
    assert read_record(stream, 6, Opcode.CHUNK, length=len(record)) == b"abc"
    for opcode, length in ((Opcode.METADATA, None), (Opcode.CHUNK, len(record) - 1)):
        with pytest.raises(McapError, match=r"no (metadata|chunk) at offset 6"):
            read_record(stream, 6, opcode, length)
    with pytest.raises(McapError, match="cut off"):
        read_record(BytesIO(record[:-1]), 0, Opcode.CHUNK)
