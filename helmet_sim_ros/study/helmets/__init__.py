"""Helmets that users bring: from meshes of shell and liner to a helmet file."""
