"""``python -m helmet_sim_ros`` is ``helmet-sim``."""

from helmet_sim_ros.cli import main

if __name__ == "__main__":
    main(prog_name="helmet-sim")
