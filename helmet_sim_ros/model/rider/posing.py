"""Where a rider's hinges rest and how stiff they are, other than in the posture of an impact."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from helmet_sim_ros.errors import SetupError


@dataclass(frozen=True)
class Posing:
    """Rest angles and stiffness of hinges by name; hashable, for models are kept by it.

    Attributes:
        rests: joint and the angle at which its spring is at rest [rad]; all others: 0.
        stiffened: joint and the factor on its stiffness and damping.
        starts: joint and its angle at the start [rad] where that is not the rest.
    """

    rests: tuple[tuple[str, float], ...]
    stiffened: tuple[tuple[str, float], ...] = ()
    starts: tuple[tuple[str, float], ...] = ()

    @classmethod
    def resting(
        cls,
        rests: Mapping[str, float],
        stiffened: Mapping[str, float] | None = None,
        starts: Mapping[str, float] | None = None,
    ) -> Posing:
        """Of mappings; ``starts`` unset: the joints start at rest."""
        kept = {k: v for k, v in (starts or {}).items() if rests.get(k, 0.0) != v}
        kept |= {k: 0.0 for k in rests if starts is not None and k not in starts}
        return cls(tuple(rests.items()), tuple((stiffened or {}).items()), tuple(kept.items()))

    def set(self, model: mujoco.MjModel) -> None:
        """Put rest angles and stiffness into a compiled model.

        Raises:
            SetupError: a joint goes beyond its range.
        """
        for joint in range(model.njnt):
            if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE):
                model.qpos_spring[model.jnt_qposadr[joint]] = 0.0
        for name, angle in (*self.rests, *self.starts):
            low, high = model.joint(name).range
            if not low <= angle <= high:
                raise SetupError.of(
                    f"joints.{name}", round(math.degrees(angle), 1),
                    f"must be from {math.degrees(low):.0f} to {math.degrees(high):.0f} deg",
                )  # fmt: skip
        for name, angle in self.rests:
            model.qpos_spring[int(model.joint(name).qposadr[0])] = angle
        for name, factor in self.stiffened:
            joint = model.joint(name)
            joint.stiffness *= factor
            model.dof_damping[int(joint.dofadr[0])] *= factor
