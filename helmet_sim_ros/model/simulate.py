"""What a setup asks for: an impact, or a whole fall."""

from __future__ import annotations

from helmet_sim_ros.biomech.record import FloatArray, ImpactRecord
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.model.fall.stepping import Falling
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup


def simulate(setup: ImpactSetup | Fall, crush: FloatArray | None = None) -> ImpactRecord:
    """Simulate one impact, or a whole fall.

    Args:
        setup: the impact or fall; its ``duration`` and ``time_step`` give the number of samples.
        crush: largest strain of each foam column in earlier impacts, ``extras["crush"]`` of the
            last one; unset: a new helmet.

    Returns:
        Every sample, SI units, of an impact from the first touch of the ground; of a fall samples
        are dense where the head strikes and thinner elsewhere (``extras["dense"]``).
        :func:`head_strikes` finds in a fall what the head strikes.

    Raises:
        DivergedError: the state stopped being finite.
    """
    impact = begun(setup, crush)
    impact.run()
    return impact.record()


def begun(setup: ImpactSetup | Fall, crush: FloatArray | None = None) -> Impact:
    """An impact or a fall at its beginning, to be advanced in slices; args as :func:`simulate`."""
    return (Falling if isinstance(setup, Fall) else Impact)(setup, crush)
