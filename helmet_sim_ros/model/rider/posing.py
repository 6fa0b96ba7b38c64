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
        all_rests, all_factors: of every joint coordinate of the body, in the order of
            ``Layout.joints``, instead of the above; of ball joints and slides they do nothing.
    """

    rests: tuple[tuple[str, float], ...]
    stiffened: tuple[tuple[str, float], ...] = ()
    starts: tuple[tuple[str, float], ...] = ()
    all_rests: tuple[float, ...] = ()
    all_factors: tuple[float, ...] = ()

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
        if self.all_rests:
            self._set_all(model)
            return
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

    def _set_all(self, model: mujoco.MjModel) -> None:
        coordinates = sum(len(of) for of in body_joints(model))
        if len(self.all_rests) != coordinates:
            raise SetupError.of(
                "impact.state", f"{len(self.all_rests)} joint coordinates",
                f"must be of this body, which has {coordinates}",
            )  # fmt: skip
        for of in body_joints(model):
            joint = of[0][0]
            if model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_HINGE):
                continue
            i = of[0][1]
            model.qpos_spring[model.jnt_qposadr[joint]] = self.all_rests[i]
            model.jnt_stiffness[joint] *= self.all_factors[i]
            model.dof_damping[model.jnt_dofadr[joint]] *= self.all_factors[i]


def body_joints(model: mujoco.MjModel) -> list[list[tuple[int, int]]]:
    """Of every joint of the body the pairs of its index and that of each of its coordinates."""
    found: list[list[tuple[int, int]]] = []
    next_one = 0
    for joint in range(model.njnt):
        if model.joint(joint).name == "root" or model.joint(joint).name.startswith(
            ("coupling_", "fit_")
        ):
            continue
        count = 3 if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL) else 1
        found.append([(joint, next_one + k) for k in range(count)])
        next_one += count
    return found
