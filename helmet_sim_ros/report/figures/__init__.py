"""Figures of drops and of oblique impacts."""
