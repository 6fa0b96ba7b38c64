"""Names of what stands in an impact log; ``docs/logs.md`` describes the whole format."""

from __future__ import annotations

#: Version of the format; a reader refuses logs of a later one. Since 2, metadata is sealed.
FORMAT_VERSION = 2
#: Key of the format in the metadata of each channel, which the checksum of the index covers.
FORMAT_KEY = "log_format"

#: Metadata record about the run: format, start, versions.
RUN = "run"
#: Prefix of the metadata record that follows the samples of each impact.
IMPACT = "impact/"

#: Prefix of the metadata record that says why an impact has no criteria.
NO_CRITERIA = "no_criteria/"

#: Metadata record of a log that was recovered: what was lost.
RECOVERED = "recovered"

#: Media type of attachments that are no text.
BINARY = "application/octet-stream"

#: Topic (in any namespace) and type of the sample blocks.
SAMPLES_TOPIC = "/impact/samples"
SAMPLES_TYPE = "std_msgs/msg/Float64MultiArray"
#: Topic (in any namespace) and type of the criteria.
CRITERIA_TOPIC = "/evaluation/criteria"
CRITERIA_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
#: The hashes of the two types (REP-2016), the same in every ROS 2 from Foxy to Jazzy: a definition
#: of the right name and with other fields is none that can be read.
TYPE_HASHES = {
    SAMPLES_TYPE: "RIHS01_1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    CRITERIA_TYPE: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
}
