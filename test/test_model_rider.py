"""The rider's body against the anthropometric table."""

import mujoco
import numpy as np
import pytest

from helmet_sim_ros.biomech import evaluate
from helmet_sim_ros.model.impact import Impact
from helmet_sim_ros.model.rider.anthropometry import anthropometry, head_circumference, head_mass
from helmet_sim_ros.model.rider.properties import Rider, Sex
from helmet_sim_ros.model.setup import ImpactSetup
from helmet_sim_ros.model.simulate import simulate
from helmet_sim_ros.study.sweeps.population import load_population

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


def rider_model(**rider: float) -> mujoco.MjModel:
    return Impact(ImpactSetup(rider=Rider(**rider))).model


def body_mass(model: mujoco.MjModel) -> float:
    bodies = [model.body(b) for b in range(model.nbody)]
    return sum(body.mass[0] for body in bodies if not body.name.startswith("helmet"))


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
    assert tuple(body.inertia) == pytest.approx(inertia, rel=6e-3)  # rounded in the table


def test_the_foot_lies_along_its_long_axis() -> None:
    body = rider_model().body("foot_left")
    assert body.mass[0] == pytest.approx(1.055, rel=1e-3)
    assert tuple(body.inertia) == pytest.approx((0.0011, 0.0043, 0.0047), rel=0.02)


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
        anthropometry(Rider(height=1.5, mass=60, head_mass=4.5)),
        anthropometry(Rider(height=1.8, mass=60, head_mass=4.5)),
    )
    ratio = 1.8 / 1.5
    for name, segment in small.segments.items():
        assert large.segments[name].length == pytest.approx(ratio * segment.length)
        turns = 1.0 if name == "head" else ratio**2  # a skull does not grow with the stature
        assert large.segments[name].inertia == pytest.approx(turns * np.array(segment.inertia))


# De Leva 1996, female: mass [%], length [mm] of a woman of 1.735 m, centre [% of the length].
WOMAN = {
    "upper_trunk": (15.45, 228.0, 50.50),
    "middle_trunk": (14.65, 205.3, 45.12),
    "lower_trunk": (12.47, 181.5, 49.20),
    "upper_arm": (2.55, 275.1, 57.54),
    "forearm": (1.38, 264.3, 45.59),
    "hand": (0.56, 78.0, 74.74),
    "thigh": (14.78, 368.5, 36.12),
    "shank": (4.81, 432.3, 44.16),
    "foot": (1.29, 228.3, 40.14),
}


def test_a_woman_has_her_own_segment_table() -> None:
    rider = Rider(sex="female", height=1.735, mass=61.9)
    segments = anthropometry(rider).segments
    rest = rider.mass - segments["head"].mass
    neck = 0.158 * 6.68
    whole = neck + sum(m * (1 if "trunk" in name else 2) for name, (m, _, _) in WOMAN.items())
    for name, (percent, length, centre) in WOMAN.items():
        assert segments[name].mass == pytest.approx(percent / whole * rest, rel=1e-6)
        assert segments[name].length * 1e3 == pytest.approx(length)
        assert segments[name].center == pytest.approx(centre / 100.0 * segments[name].length)
    trunk = segments["upper_trunk"]
    assert trunk.inertia[0] == pytest.approx(trunk.mass * (0.466 * trunk.length) ** 2)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_a_body_of_either_sex_has_the_mass_and_stature_asked_for(sex: Sex) -> None:
    rider = Rider(sex=sex, height=1.68, mass=64.0)
    model = Impact(ImpactSetup(rider=rider)).model
    assert body_mass(model) == pytest.approx(64.0, rel=1e-6)
    segments = anthropometry(rider).segments
    stacked = ("head", "neck", "upper_trunk", "middle_trunk", "lower_trunk", "thigh", "shank")
    height = sum(segments[name].length for name in stacked) + anthropometry(rider).ankle_height
    assert height == pytest.approx(1.68)


def test_the_head_follows_the_skull_and_not_the_waist() -> None:
    assert head_mass("male", 1.75, 77.0) == pytest.approx(4.5)
    light, heavy = (head_mass("male", 1.75, mass) for mass in (50.0, 120.0))
    # Clauser's 14.8 kg per metre of circumference, which grows by 43 mm per unit of ln(mass).
    assert heavy - light == pytest.approx(14.8 * 0.04295 * np.log(120 / 50), rel=1e-6)
    assert head_mass("female", 1.63, 67.0) < head_mass("male", 1.76, 84.0)


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_circumference_is_the_conditional_mean_of_the_measured_population(sex: Sex) -> None:
    people = getattr(load_population("ansur_ii"), sex)
    deviation = np.array([people.height[1], people.log_mass[1]])
    for height, mass in ((1.6, 50.0), (1.75, 77.0), (1.9, 120.0)):
        z = (np.array([height, np.log(mass)]) - [people.height[0], people.log_mass[0]]) / deviation
        expected = people.correlation[2, :2] @ np.linalg.solve(people.correlation[:2, :2], z)
        around = people.head_circumference[0] + people.head_circumference[1] * expected
        assert head_circumference(sex, height, mass) == pytest.approx(around, abs=1e-4)


def test_peak_acceleration_hardly_depends_on_the_body_mass() -> None:
    peaks = [
        evaluate(
            simulate(
                ImpactSetup(
                    rider=Rider(mass=mass), duration=0.02, overrides={"helmet.coupling": "foam"}
                )
            )
        ).peak_g.value
        for mass in (50.0, 120.0)
    ]
    assert 0.91 < peaks[1] / peaks[0] < 1.0


def test_a_larger_head_is_not_a_denser_one() -> None:
    small, large = (anthropometry(Rider(head_mass=m)).segments["head"] for m in (3.5, 5.5))
    ratio = (5.5 / 3.5) ** (5.0 / 3.0)
    assert large.inertia == pytest.approx(ratio * np.array(small.inertia))


def test_a_heavier_head_keeps_the_body_mass() -> None:
    model = rider_model(mass=77.0, head_mass=5.5)
    assert model.body("head").mass[0] == pytest.approx(5.5)
    assert body_mass(model) == pytest.approx(77.0, rel=1e-4)


def test_the_joints_of_the_rider_are_limited_sprung_and_damped() -> None:
    model = rider_model()
    for j in range(model.njnt):
        joint = model.joint(j)
        if joint.name == "root" or joint.name.startswith(("coupling_", "fit_", "neck_")):
            continue  # the neck: test_model_neck.py
        assert model.jnt_limited[j] and joint.range[0] < joint.range[1], joint.name
        assert joint.stiffness[0] > 0.0 and joint.damping[0] > 0.0, joint.name


def test_a_joint_exceeds_its_range_only_slightly_even_in_a_hard_impact() -> None:
    impact = Impact(ImpactSetup(normal_velocity=7.5, tangential_velocity=10.0, duration=0.06))
    impact.advance(impact.total)
    record, model = impact.record(), impact.model
    angles = dict(zip(record.joint_names, record.joint_positions.T, strict=True))
    limits = {name: model.joint(name).range for name in angles if not name.startswith("neck_")}
    excess = {
        name: max(angle.max() - limits[name][1], limits[name][0] - angle.min())
        for name, angle in angles.items()
        if name in limits
    }
    assert max(excess.values()) > 0.0  # the stops are reached at all
    assert max(excess.values()) < np.radians(20.0)
