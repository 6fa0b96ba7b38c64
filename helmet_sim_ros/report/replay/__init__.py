"""An impact in motion: drawn by MuJoCo into a video or a window."""
