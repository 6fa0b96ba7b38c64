"""Identification: drop tests become the coupling springs of a helmet."""
