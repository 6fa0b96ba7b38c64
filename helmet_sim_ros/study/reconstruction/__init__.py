"""From a crashed helmet back to its crash."""
