"""Names of what stands in an impact log; ``docs/logs.md`` describes the whole format."""

from __future__ import annotations

#: Version of the format; a reader refuses logs of a later one.
FORMAT_VERSION = 1

#: Metadata record about the run: format, start, versions.
RUN = "run"
#: Prefix of the metadata record that follows the samples of each impact.
IMPACT = "impact/"

#: Prefix of the metadata record that says why an impact has no criteria.
NO_CRITERIA = "no_criteria/"

#: Metadata record of a log that was recovered: what was lost.
RECOVERED = "recovered"

#: Topic (in any namespace) and type of the sample blocks.
SAMPLES_TOPIC = "/impact/samples"
SAMPLES_TYPE = "std_msgs/msg/Float64MultiArray"
#: Topic (in any namespace) and type of the criteria.
CRITERIA_TOPIC = "/evaluation/criteria"
CRITERIA_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
