"""Scenarios: a YAML file becomes a matrix of impacts, beside it what was published."""
