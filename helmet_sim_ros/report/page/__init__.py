"""The report of some logs: one self-contained HTML page."""
