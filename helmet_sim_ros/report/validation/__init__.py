"""docs/validation.md and its figures."""
