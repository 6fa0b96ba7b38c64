"""The rider's body against the anthropometric table."""

import mujoco
import numpy as np
import pytest

from helmet_sim_ros.model.anthropometry import anthropometry
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.setup import ImpactSetup, Rider

# De Leva 1996, male, scaled to 1.75 m and 77 kg: mass [kg], centre from the upper end [mm],
# moments of inertia about the sagittal, transverse and longitudinal axes [kg m^2].
TABLE = {
    "thorax": (12.289, 123.3, (0.1856, 0.0745, 0.1574)),
    "abdomen": (12.574, 97.5, (0.1371, 0.0866, 0.1292)),
    "pelvis": (8.601, 89.6, (0.0698, 0.0560, 0.0636)),
    "upper_arm_left": (2.087, 163.4, (0.01359, 0.01211, 0.00418)),
    "forearm_right": (1.247, 123.6, (0.00694, 0.00640, 0.00133)),
    "hand_left": (0.470, 68.5, (0.00139, 0.00093, 0.00057)),
    "thigh_right": (10.903, 173.8, (0.2126, 0.2126, 0.0436)),
    "shank_left": (3.334, 194.5, (0.0413, 0.0393, 0.0067)),
}
HELMET = ("helmet", "helmet_rest")


def rider_model(**rider: float) -> mujoco.MjModel:
    return Impact(ImpactSetup(rider=Rider(**rider))).model


def body_mass(model: mujoco.MjModel) -> float:
    return sum(
        model.body(b).mass[0] for b in range(model.nbody) if model.body(b).name not in HELMET
    )


@pytest.mark.parametrize(("height", "mass"), [(1.75, 77.0), (1.55, 52.0), (1.95, 110.0)])
def test_total_mass_and_stature_follow_the_rider(height: float, mass: float) -> None:
    model = rider_model(height=height, mass=mass)
    assert body_mass(model) == pytest.approx(mass, rel=1e-4)
    assert stature(model) == pytest.approx(height, rel=1e-4)


def stature(model: mujoco.MjModel) -> float:
    """Vertex to sole with every joint straight, from the model's own frames."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    data.qpos[3] = 1.0
    mujoco.mj_kinematics(model, data)
    scale = data.body("head").xpos[2] - data.body("thorax").xpos[2]
    body = anthropometry(Rider())
    head_depth = body.head_depth * scale / (body.cervicale_depth - body.head_depth)
    sole = data.body("foot_left").xpos[2] - body.ankle_height * scale / (
        body.cervicale_depth - body.head_depth
    )
    return float(data.body("head").xpos[2] + head_depth - sole)


@pytest.mark.parametrize("name", TABLE)
def test_each_segment_has_the_mass_centre_and_inertia_of_the_table(name: str) -> None:
    mass, centre, inertia = TABLE[name]
    body = rider_model().body(name)
    assert body.mass[0] == pytest.approx(mass, rel=1e-3)
    assert -body.ipos[2] * 1e3 == pytest.approx(centre, abs=0.1)
    assert tuple(body.inertia) == pytest.approx(inertia, rel=1e-3)


def test_the_foot_lies_along_its_long_axis() -> None:
    body = rider_model().body("foot_left")
    assert body.mass[0] == pytest.approx(1.055, rel=1e-3)
    assert tuple(body.inertia) == pytest.approx((0.0011, 0.0043, 0.0047), rel=1e-3)


def test_head_and_neck_together_have_the_mass_and_centre_of_the_table() -> None:
    body = anthropometry(Rider())
    head, neck = body.segments["head"], body.segments["neck"]
    assert head.mass == pytest.approx(4.5)
    assert head.inertia == pytest.approx((0.0214, 0.0232, 0.0154), rel=5e-3)  # Beier 1980
    assert head.mass + neck.mass == pytest.approx(5.344, rel=1e-3)
    centre = head.mass * head.center + neck.mass * (body.head_joint_depth + neck.center)
    assert centre / (head.mass + neck.mass) == pytest.approx(0.1221, abs=1e-4)


def test_segments_scale_geometrically() -> None:
    small, large = (
        anthropometry(Rider(height=1.5, mass=60)),
        anthropometry(Rider(height=1.8, mass=60)),
    )
    ratio = 1.8 / 1.5
    for name, segment in small.segments.items():
        assert large.segments[name].length == pytest.approx(ratio * segment.length)
        assert large.segments[name].inertia == pytest.approx(ratio**2 * np.array(segment.inertia))


def test_a_heavier_head_keeps_the_body_mass() -> None:
    model = rider_model(mass=77.0, head_mass=5.5)
    assert model.body("head").mass[0] == pytest.approx(5.5)
    assert body_mass(model) == pytest.approx(77.0, rel=1e-4)


def test_the_joints_of_the_rider_are_limited_sprung_and_damped() -> None:
    model = rider_model()
    for j in range(model.njnt):
        joint = model.joint(j)
        if joint.name == "root" or joint.name.startswith("coupling_"):
            continue
        assert model.jnt_limited[j] and joint.range[0] < joint.range[1], joint.name
        assert joint.stiffness[0] > 0.0 and joint.damping[0] > 0.0, joint.name


def test_an_axial_pull_on_the_head_meets_the_axial_stiffness_of_the_neck() -> None:
    """Static: gravity off, head pulled along the neck while the thorax is held."""
    setup = ImpactSetup(gravity=0.0, overrides={"rider.neck.axial_stiffness": 80e3})
    model = Impact(setup).model
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    data.qpos[[int(model.joint(j).qposadr[0]) for j in range(1, model.njnt)]] = [
        model.qpos_spring[int(model.joint(j).qposadr[0])] for j in range(1, model.njnt)
    ]
    address = int(model.joint("neck_axial").dofadr[0])
    data.qpos[int(model.joint("neck_axial").qposadr[0])] = 0.001
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[address] == pytest.approx(-80.0, rel=1e-6)


def test_a_joint_exceeds_its_range_only_slightly_even_in_a_hard_impact() -> None:
    impact = Impact(ImpactSetup(normal_velocity=7.5, tangential_velocity=10.0, duration=0.06))
    impact.advance(impact.total)
    record, model = impact.record(), impact.model
    angles = dict(zip(record.joint_names, record.joint_positions.T, strict=True))
    limits = {name: model.joint(name).range for name in angles}
    excess = {
        name: max(angle.max() - limits[name][1], limits[name][0] - angle.min())
        for name, angle in angles.items()
    }
    assert max(excess.values()) > 0.0  # the stops are reached at all
    assert max(excess.values()) < np.radians(20.0)
