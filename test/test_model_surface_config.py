"""Surfaces as files: what is shipped, what is refused, how they are drawn."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from surfaces import SIZES

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.surface.config import SurfaceConfig
from helmet_sim_ros.model.surface.drawing import add_geoms, drawn
from helmet_sim_ros.model.surface.scenes import load_surface
from helmet_sim_ros.model.surface.shapes import nearest, signed_distance
from helmet_sim_ros.resources import share_directory

SHIPPED = sorted(p.stem for p in (share_directory() / "config" / "surfaces").glob("*.yaml"))
GREY = (0.5, 0.5, 0.5, 1.0)


def surface(*shapes: dict[str, Any], **values: Any) -> SurfaceConfig:
    made: SurfaceConfig = SurfaceConfig.from_mapping({"shapes": list(shapes), **values}, "my.yaml")
    return made


def refused(*shapes: dict[str, Any], **values: Any) -> str:
    with pytest.raises(SetupError) as caught:
        surface(*shapes, **values)
    message = str(caught.value)
    assert message.startswith("my.yaml: ")
    return message.removeprefix("my.yaml: ")


def test_the_surfaces_that_scenarios_and_standards_name_are_shipped() -> None:
    assert {
        "ground", "road", "incline_45", "incline_15", "flat_anvil", "kerbstone", "hemisphere",
        "bar_anvil_45", "bar_anvil_15", "edge_anvil", "post", "kerb",
    } <= set(SHIPPED)  # fmt: skip


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_surface_says_what_it_is_and_starts_at_its_target(name: str) -> None:
    config = load_surface(name)
    assert config.description and config.source
    point, axes = config.frame
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    i, distance, *normal, _ = nearest(config.compiled(), *(point + 0.01 * axes[:, 2]))
    assert distance == pytest.approx(0.01, abs=1e-9)
    assert normal == pytest.approx(axes[:, 2], abs=1e-6)
    assert config.compiled().friction[i] == config.friction
    assert config is load_surface(name) and hash(config) == hash(load_surface(name))


def test_ground_is_the_plane_below_zero() -> None:
    ground = load_surface("ground")
    assert ground.is_flat_ground
    assert (ground.frame[0] == 0.0).all() and (ground.frame[1] == np.eye(3)).all()
    assert signed_distance(ground.compiled(), 0, 3.0, -2.0, 0.7) == (0.7, 0.0, 0.0, 1.0, 0.0)
    assert ground.friction == 0.4
    assert not load_surface("kerb").is_flat_ground


@pytest.mark.parametrize(("name", "tilt"), [("incline_15", 15.0), ("incline_45", 45.0)])
def test_downhill_is_heading_90(name: str, tilt: float) -> None:
    _, axes = load_surface(name).frame
    a = np.radians(tilt)
    assert axes[:, 0] == pytest.approx([1.0, 0.0, 0.0])
    assert axes[:, 1] == pytest.approx([0.0, np.cos(a), -np.sin(a)])
    assert axes[:, 2] == pytest.approx([0.0, np.sin(a), np.cos(a)])


def test_the_bar_anvil_of_15_deg_is_steep() -> None:
    """Method A of UN R22.05 counts from the vertical: the drop grazes the anvil."""
    _, axes = load_surface("bar_anvil_15").frame
    assert axes[2, 2] == pytest.approx(np.sin(np.radians(15.0)))


def test_friction_is_that_of_the_caller_the_shape_or_the_file() -> None:
    ball = {"kind": "sphere", "radius": 0.1, "position": [0.0, 1.0, 0.0], "friction": 0.9}
    config = surface({"kind": "half_space"}, ball, friction=0.3)
    assert config.compiled().friction.tolist() == [0.3, 0.9]
    assert config.compiled(0.55).friction.tolist() == [0.55, 0.55]
    assert config.compiled() is config.compiled()


def test_any_file_is_a_surface_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("shapes:\n  - kind: half_space\n    position: [0, 0, -1]\n")
    with pytest.raises(SetupError, match=r"mine.yaml: target.point = .* 1 m off shapes\[0\]"):
        load_surface(str(path))
    path.write_text(
        "shapes:\n  - {kind: half_space, position: [0, 0, -1]}\ntarget: {point: [0, 0, -1]}"
    )
    assert load_surface(str(path)).frame[0].tolist() == [0.0, 0.0, -1.0]


def test_an_unknown_surface_is_refused_with_the_known_ones() -> None:
    with pytest.raises(SetupError, match=r"impact.surface = 'moon': must be one of .*kerbstone"):
        load_surface("moon")


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ({"kind": "cone"}, "shapes[0].kind = 'cone': must be one of half_space, sphere"),
        ({"radius": 0.1}, "shapes[0].kind = None: must be one of"),
        ({"kind": "sphere"}, "shapes[0].radius = None: is required"),
        ({"kind": "sphere", "radius": -0.05}, "shapes[0].radius = -0.05: must be a number from ab"),
        ({"kind": "sphere", "radius": "big"}, "shapes[0].radius = 'big': must be a number"),
        ({"kind": "sphere", "radius": 0.1, "length": 1.0}, "shapes[0].length = 1.0: unknown key"),
        ({"kind": "capsule", "radius": 0.1, "length": 0.1}, "must be at least twice the radius"),
        ({"kind": "box", "half_sizes": [0.1, 0.0, 0.1]}, "each must be above 0"),
        (
            {"kind": "box", "half_sizes": [0.1, 0.02, 0.1], "edge_radius": 0.03},
            "shapes[0].edge_radius = 0.03: must not exceed the smallest half size, 0.02 m",
        ),
        (
            {"kind": "disc", "radius": 0.1, "height": 0.02, "edge_radius": 0.02},
            "shapes[0].edge_radius = 0.02: must not exceed radius and half the height, 0.01 m",
        ),
        ({**SIZES["wedge"], "kind": "wedge", "half_angle_deg": 90.0}, "from 5 to 85 deg"),
        ({**SIZES["wedge"], "kind": "wedge", "height": 0.003}, "height of the rounding, 0.0031 m"),
        ({"kind": "ellipsoid", "semi_axes": [0.1, -0.1, 0.1]}, "each must be above 0"),
        ({"kind": "half_space", "friction": -0.1}, "shapes[0].friction = -0.1: must be a number"),
        (
            {"kind": "half_space", "tilt_deg": 1.0, "rotation_deg": [0.0, 0.0, 1.0]},
            "shapes[0].rotation_deg = (0.0, 0.0, 1.0): must not be given beside tilt_deg",
        ),
    ],
)  # fmt: skip
def test_a_bad_shape_is_refused_by_key_value_and_range(shape: dict, message: str) -> None:
    assert message in refused(shape)


def test_every_bad_shape_is_named_at_once() -> None:
    message = refused({"kind": "sphere", "radius": 0.0}, {"kind": "cone"})
    assert "shapes[0].radius" in message and "shapes[1].kind" in message


def test_a_surface_without_shapes_is_refused() -> None:
    assert "at least one shape" in refused()
    with pytest.raises(SetupError, match="shapes = None: is required"):
        SurfaceConfig.from_mapping({}, "my.yaml")


def test_a_target_off_or_inside_the_surface_is_refused() -> None:
    ball = {"kind": "sphere", "radius": 0.1}
    assert "target.point = (0.0, 0.0, 0.2)" in refused(ball, target={"point": [0.0, 0.0, 0.2]})
    assert "0.1 m off shapes[0] (sphere)" in refused(ball, target={"point": [0.0, 0.0, 0.2]})
    assert "0.05 m inside shapes[0]" in refused(ball, target={"point": [0.0, 0.0, 0.05]})


def test_a_first_touch_inside_another_shape_is_refused() -> None:
    block = {"kind": "box", "half_sizes": [0.1, 0.1, 0.02]}
    message = refused({"kind": "half_space"}, block)
    assert "it is on shapes[0] (half_space) and 0.02 m inside shapes[1] (box)" in message


def test_a_target_with_a_wrong_normal_is_refused_and_told_the_right_one() -> None:
    message = refused({"kind": "half_space", "tilt_deg": 30.0})
    assert "target.normal" in message and "[0.0, 0.5, 0.866025]" in message
    assert "target.normal" in refused({"kind": "half_space"}, target={"normal": [0.0, 0.0, -1.0]})


def test_on_an_edge_every_normal_between_the_faces_will_do() -> None:
    block = {"kind": "box", "half_sizes": [1.0, 1.0, 1.0], "position": [0.0, -1.0, -1.0]}
    for tilt in (0.0, 45.0, 90.0):
        assert surface(block, target={"tilt_deg": tilt}).frame[1][:, 2] @ [0, 1, 1] >= 1.0 - 1e-9
    for tilt in (-1.0, 91.0):
        assert "target.normal" in refused(block, target={"tilt_deg": tilt})


def test_heading_0_needs_a_direction_along_the_surface() -> None:
    wall = {"kind": "half_space", "rotation_deg": [0.0, 90.0, 0.0]}
    assert "target.x_axis" in refused(wall, target={"normal": [1.0, 0.0, 0.0]})
    config = surface(wall, target={"normal": [2.0, 0.0, 0.0], "x_axis": [0.3, 0.0, 1.0]})
    assert config.frame[1] == pytest.approx(np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]]), abs=1e-15)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_drawn_surface_is_where_the_surface_is(name: str) -> None:
    """Rays along the target's normal meet the drawn solids where the distance is zero."""
    config = load_surface(name)
    spec = mujoco.MjSpec()
    add_geoms(spec, config, GREY)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.geom(i).name for i in range(model.ngeom)]
    assert names == (
        ["ground"] if config.is_flat_ground else [f"surface_{i}" for i in range(len(drawn(config)))]
    )
    assert not model.geom_contype.any() and not model.geom_conaffinity.any()
    point, axes = config.frame
    for x, y in ((0.0, 0.0), (0.02, 0.0), (-0.02, 0.001), (0.0, 0.03)):
        start = point + axes @ np.array([x, y, 0.1])
        hit = mujoco.mj_ray(model, data, start, -axes[:, 2], None, 1, -1, np.zeros(1, np.int32))
        if hit < 0.0:  # beside it
            assert name == "edge_anvil" and y > 0.003
            continue
        distance = nearest(config.compiled(), *(start - hit * axes[:, 2]))[1]
        # Rounded edges are drawn sharp.
        assert distance == pytest.approx(0.0, abs=0.01 if name == "kerb" else 1e-3)


def test_the_thinnest_shape_limits_the_depth() -> None:
    assert load_surface("ground").half_thickness == np.inf
    assert load_surface("edge_anvil").half_thickness == 0.003
    wedge = load_surface("kerbstone")
    inside = np.linspace(-0.099, 0.0, 4000)
    deepest = -min(signed_distance(wedge.compiled(), 0, 0.0, 0.0, z)[0] for z in inside)
    assert wedge.half_thickness == pytest.approx(deepest, abs=2e-5)


def test_a_shape_is_at_rest_unless_it_moves_and_does_not_brake_unless_it_is_told() -> None:
    ground = {"kind": "half_space"}
    still = surface(ground)
    assert not still.is_carried
    assert still.moving(None, 3.0).position == pytest.approx(np.zeros((1, 3)), abs=0.0)
    ball = {"kind": "sphere", "radius": 0.5, "position": [0.0, 0.0, -1.0]}
    going = surface(ground, ball | {"velocity": [2.0, -1.0, 0.0]})
    assert going.is_carried
    later = going.moving(None, 3.0)
    assert later.position == pytest.approx(np.array([[0.0, 0.0, 0.0], [6.0, -3.0, -1.0]]))
    assert later.velocity == pytest.approx(np.array([[0.0, 0.0, 0.0], [2.0, -1.0, 0.0]]))
    slowing = surface(ground, ball | {"velocity": [2.0, 0.0, 0.0], "braking": 0.5})
    assert slowing.moving(None, 2.0).position[1, 0] == pytest.approx(2.0 * 2.0 - 0.5 * 0.5 * 2.0**2)
    assert "from 0 to 1000" in refused(ground, ball | {"braking": -0.1})
