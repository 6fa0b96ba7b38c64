"""The head in its helmet: padding, friction at local pressure, chin strap."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from helmet_sim_ros import ImpactSetup, simulate
from helmet_sim_ros.model.force import fit as law
from helmet_sim_ros.model.force.bodies import Loads, Motion, motion_of, no_loads
from helmet_sim_ros.model.force.fit import RECOVERY, Fit
from helmet_sim_ros.model.head_surface import HeadSurface, load_head_surface
from helmet_sim_ros.model.helmet import Helmet, load_helmet
from helmet_sim_ros.model.impact import Impact

AXES = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.48, 0.6, 0.64)]
STEP = 1e-6  # s, short against the recovery of the padding
REST = (1.0, 0.0, 0.0, 0.0)


def worn(friction: float = 0.3, skin: HeadSurface | None = None, **padding: float) -> Fit:
    helmet: Helmet = load_helmet("fullface").replaced(
        {f"padding.{name}": value for name, value in padding.items()}
    )
    return law.fit(helmet, skin or HeadSurface(friction=friction), 0, 0)


def one_patch(fit: Fit, index: int = 5) -> Fit:
    """The same with one patch and a strap that is never taut."""
    cut = {
        name: getattr(fit, name)[index : index + 1].copy()
        for name in ("point", "area", "stick", "deepest")
    }
    return fit._replace(**cut, strap=fit.strap._replace(length=1.0))


def acting(
    fit: Fit, shift: np.ndarray, speed: np.ndarray | None = None, turn: Rotation | None = None,
    spin: np.ndarray | None = None, step: float = STEP,
) -> np.ndarray:  # fmt: skip
    """Force [N] and moment [N m] of the head on the helmet, head axes, at a shift [m] and turn."""
    nothing = np.zeros((0, 3))
    quaternion = REST if turn is None else turn.as_quat()[[3, 0, 1, 2]]
    qpos = np.array([*shift, *quaternion])
    qvel = np.concatenate([np.zeros(3) if v is None else v for v in (speed, spin)])
    motion = Motion(qpos, qvel, nothing, nothing, nothing, np.zeros(3), nothing, nothing, 0.0)
    loads = Loads(np.zeros(6), np.zeros((0, 6)), np.zeros(6), np.zeros(3), np.zeros((2, 9)))
    law.apply(fit, step, motion, loads)
    assert loads.generalised[:3] == pytest.approx(-loads.coupling[:3], abs=1e-12)
    return -loads.coupling


def normal_of(fit: Fit, shift: np.ndarray) -> np.ndarray:
    _, normal = law.above_head(tuple(fit.point[0] + shift - fit.center), law.inverse_of(fit.axes))
    return np.array(normal)


def test_the_pressure_rises_from_the_modulus_to_closed_pores_and_its_energy_is_its_integral() -> (
    None
):
    padding = worn().padding
    slope = law.pressure(padding, 1e-7) / 1e-7
    assert slope == pytest.approx(padding.modulus / padding.thickness, rel=1e-3)
    full = padding.densification * padding.thickness
    compressions = np.linspace(0.0, 1.1 * full, 300)
    pressures = [law.pressure(padding, float(d)) for d in compressions]
    assert np.all(np.diff(pressures) > 0.0)
    assert law.pressure(padding, 0.9 * full) > 5.0 * padding.modulus
    kink = law.LINEAR_FROM * full
    for d in (0.2 * full, 0.8 * full, full):
        area, _ = quad(lambda x: law.pressure(padding, x), 0.0, d, points=[min(kink, d)])
        assert law.energy(padding, d) == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("direction", AXES)
@pytest.mark.parametrize("force", [100.0, 2000.0])
def test_a_slow_push_goes_as_far_as_is_said(
    direction: tuple[float, float, float], force: float
) -> None:
    """The static approach, against the forces of the loop."""
    along = np.array(direction)
    fit = worn(friction=0.0)
    fit = fit._replace(strap=fit.strap._replace(length=1.0))
    distance = law.approach(fit, along, force)
    assert 0.0 < distance < 2.0 * fit.padding.thickness
    pushed = acting(fit, -distance * along)
    # In MuJoCo's signs: the helmet is pushed along with the head.
    assert pushed[:3] @ along == pytest.approx(force, rel=1e-6)
    assert law.approach(fit, along, 2.0 * force) > distance


def test_a_press_and_its_release_lose_all_but_the_stated_share() -> None:
    """Or, where that is more, what skin and skull give back over their elastic way."""
    shares = []
    for returned in (0.05, 0.3, 0.45):
        fit = one_patch(worn(friction=0.0, damping=0.0, energy_returned=returned))
        inwards = -normal_of(fit, np.zeros(3))
        way = np.linspace(0.0, 0.5 * fit.padding.thickness, 4001)
        forces = [acting(fit, d * inwards, step=1e-9)[:3] @ -inwards for d in way]
        released = [acting(fit, d * inwards, step=1e-9)[:3] @ -inwards for d in way[::-1]]
        taken, given = np.trapezoid(forces, way), np.trapezoid(released[::-1], way)
        full, energy = law.pressure(fit.padding, way[-1]), law.energy(fit.padding, way[-1])
        assert taken == pytest.approx(fit.area[0] * energy, rel=0.01)
        shares.append(max(returned, law.ELASTIC * full / (2.0 * energy)))
        assert given / taken == pytest.approx(shares[-1], rel=0.01)
    assert shares[0] > 0.05 and shares[-1] == 0.45


def test_a_padding_never_gives_back_more_than_it_took_up() -> None:
    """Loops of every depth, from one much shorter than the elastic way of skin and skull."""
    for deepest in (2e-5, 1e-4, 2.5e-4, 1e-3, 3e-3):
        fit = one_patch(worn(friction=0.0, damping=0.0))
        inwards = -normal_of(fit, np.zeros(3))
        way = np.linspace(0.0, deepest, 500)
        loop = np.concatenate([way, way[::-1]])
        forces = [acting(fit, d * inwards, step=1e-9)[:3] @ -inwards for d in loop]
        assert np.trapezoid(forces, loop) > -1e-3 * np.trapezoid(forces[:500], way)


def test_what_padding_and_strap_hold_is_what_was_put_in_until_it_recovers() -> None:
    fit = worn(friction=0.0, damping=0.0)
    way = np.concatenate([np.linspace(0.0, 0.003, 600), np.linspace(0.003, 0.0027, 300)])
    direction = np.array([0.0, -0.8, 0.6])
    work, before = 0.0, np.zeros(6)
    for i, d in enumerate(way):
        now = acting(fit, d * direction, step=1e-9)
        if i:
            work -= 0.5 * (now + before)[:3] @ direction * (d - way[i - 1])
        before = now
        if i in (300, 599, 750, 899):
            qpos = np.array([*(d * direction), *REST])
            assert law.held_energy(fit, qpos) == pytest.approx(work, rel=0.01)
    qpos = np.array([0.0, 0.0, 0.0, *REST])
    held = law.held_energy(fit, qpos)
    for _ in range(1000):
        acting(fit, np.zeros(3), step=0.01 * RECOVERY)
    assert held > 0.1 * work
    assert law.held_energy(fit, qpos) < 1e-3 * held


def test_a_padding_recovers_after_the_blow() -> None:
    fit = one_patch(worn(friction=0.0, damping=0.0))
    inwards = -normal_of(fit, np.zeros(3))
    first = acting(fit, 0.001 * inwards)[:3] @ -inwards
    acting(fit, 0.003 * inwards)
    assert acting(fit, 0.001 * inwards)[:3] @ -inwards < 0.2 * first
    for _ in range(2000):
        acting(fit, np.zeros(3), step=0.01 * RECOVERY)
    assert acting(fit, 0.001 * inwards)[:3] @ -inwards == pytest.approx(first, rel=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.16, 0.75])
def test_friction_is_bounded_by_the_pressure_of_its_own_patch(friction: float) -> None:
    fit = one_patch(worn(friction=friction, damping=0.0))
    inwards = -normal_of(fit, np.zeros(3))
    ratios = []
    for step in range(400):
        shift = 0.002 * (1.0 + 0.02 * np.sin(0.05 * step)) * inwards
        normal = normal_of(fit, shift)
        along = np.cross(normal, [0.0, 0.0, 1.0])
        along /= np.linalg.norm(along)
        force = acting(fit, shift, speed=3.0 * along, step=1e-5)[:3]
        pressed = force @ normal
        rubbed = force - pressed * normal
        assert pressed > 0.0
        assert np.linalg.norm(rubbed) <= friction * pressed * (1 + 1e-9) + 1e-9
        assert rubbed @ along <= 1e-9
        ratios.append(float(np.linalg.norm(rubbed) / pressed))
    assert max(ratios) == pytest.approx(friction, rel=1e-6, abs=1e-9)


def test_below_its_limit_a_patch_shears_like_padding_and_skin_in_series() -> None:
    bare, skin = HeadSurface(friction=2.0), HeadSurface(
        friction=2.0, thickness=5e-3, shear_modulus=75e3
    )  # fmt: skip
    compression, slip = 0.001, 1e-5
    forces = []
    for surface in (bare, skin):
        fit = one_patch(worn(skin=surface, relaxation=0.0))
        shift = -compression * normal_of(fit, np.zeros(3))
        outside, normal = law.above_head(
            tuple(fit.point[0] + shift - fit.center), law.inverse_of(fit.axes)
        )
        along = np.cross(normal, [0.0, 0.0, 1.0])
        along /= np.linalg.norm(along)
        force = acting(fit, shift, speed=slip / 1e-6 * along, step=1e-6)[:3]
        forces.append(-force @ along)
        depth = fit.padding.preload - outside
        soft = depth / law.pressure(fit.padding, depth) / fit.padding.shear
        expected = fit.area[0] * slip / (soft + fit.padding.skin)
        assert forces[-1] == pytest.approx(expected, rel=1e-6)
    assert forces[1] < 0.9 * forces[0]


def test_head_and_helmet_push_each_other_and_nothing_else() -> None:
    """Forces act on the joint axes between the two alone: their sum on both is zero."""
    impact = Impact(ImpactSetup(tangential_velocity=8.0))
    impact.advance(200)
    fitted, first = impact.fresh_fit(), impact.layout.fit_velocity
    loads = no_loads(impact.model)
    law.apply(fitted, 5e-5, motion_of(impact._data), loads)
    own = loads.generalised[first : first + 6].copy()
    loads.generalised[first : first + 6] = 0.0
    assert np.linalg.norm(own[:3]) > 100.0
    assert not loads.generalised.any() and not loads.wrenches.any() and not loads.surface.any()
    assert own[:3] == pytest.approx(-loads.coupling[:3])
    back = Rotation.from_quat(
        impact._data.qpos[impact.layout.fit + 3 : impact.layout.fit + 7][[1, 2, 3, 0]]
    )
    assert back.apply(own[3:]) == pytest.approx(-loads.coupling[3:])


def test_the_two_sides_of_a_head_are_equal() -> None:
    shift, turn, mirror = np.array([0.001, 0.002, -0.001]), np.array([0.02, 0.03, 0.05]), [1, -1, 1]
    axial = np.array([-1, 1, -1])
    force = acting(worn(), shift, turn=Rotation.from_rotvec(turn))
    other = acting(worn(), shift * mirror, turn=Rotation.from_rotvec(turn * axial))
    assert other[:3] == pytest.approx(force[:3] * mirror, rel=1e-9)
    assert other[3:] == pytest.approx(force[3:] * axial, rel=1e-9)


def test_the_strap_pulls_only_and_holds_a_helmet_that_is_pulled_off() -> None:
    fit = worn(friction=0.0)
    fit = fit._replace(area=0.0 * fit.area)  # the strap alone
    strap = fit.strap
    assert np.array_equal(acting(fit, np.zeros(3)), np.zeros(6))
    for up in (0.01, 0.03):
        force = acting(fit, np.array([0.0, 0.0, up]))
        left = np.array(strap.chin) - strap.anchor - np.array([0.0, 0.0, up])
        stretch = np.linalg.norm(left) - strap.length
        if stretch > 0.0:
            tension = strap.stiffness * stretch
            assert force[2] == pytest.approx(2.0 * tension * left[2] / np.linalg.norm(left))
            assert force[1] == pytest.approx(0.0, abs=1e-9)
    assert force[2] < -100.0
    assert acting(fit, np.array([0.0, 0.0, 0.03]), speed=np.array([0.0, 0.0, 1.0]))[2] < force[2]
    fast = acting(fit, np.array([0.0, 0.0, 0.03]), speed=np.array([0.0, 0.0, -1e3]))
    assert np.array_equal(fast, np.zeros(6))  # never pushes


def test_the_patches_cover_the_head_down_to_the_rim() -> None:
    helmet = load_helmet("fullface")
    fit = law.fit(helmet.replaced({"padding.patches": 2000}), load_head_surface("scalp"), 0, 0)
    inside = np.array(helmet.shell.semi_axes) - helmet.liner.thickness
    assert fit.axes == pytest.approx(inside)
    assert ((fit.point / inside) ** 2).sum(axis=1) == pytest.approx(1.0)
    assert fit.point[:, 2].min() == pytest.approx(helmet.padding.lowest, abs=3e-3)
    # The shadow of what covers the head from above is the whole ellipse.
    outward = fit.point / inside**2
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    shadow = (fit.area * np.maximum(outward[:, 2], 0.0)).sum()
    assert shadow == pytest.approx(np.pi * inside[0] * inside[1], rel=0.01)


def test_peaks_hardly_depend_on_the_number_of_patches() -> None:
    def peak(patches: int) -> float:
        setup = ImpactSetup(
            rig="headform", tangential_velocity=5.0, duration=0.02,
            overrides={"helmet.coupling": "foam", "helmet.padding.patches": patches},
        )  # fmt: skip
        return float(np.linalg.norm(simulate(setup).head_acceleration, axis=1).max())

    n = load_helmet("fullface").padding.patches
    assert peak(n) == pytest.approx(peak(8 * n), rel=0.03)


@pytest.mark.parametrize(
    ("coupling", "rates", "padding"),
    [
        ("spring", "single", {}),  # stiff, on a metal head: its shear turned round at each step
        ("foam", "single", {}),
        ("foam", "several", {"relaxation": 0.01, "shear_modulus": 15e3, "modulus": 40e3,
                             "thickness": 0.004}),
    ],
)  # fmt: skip
def test_a_drop_on_the_crown_does_not_make_the_head_tremble(coupling, rates, padding):
    setup = ImpactSetup(
        rig="headform", helmet="fullface_paper", direction="top", normal_velocity=7.5, rates=rates,
        overrides={"helmet.coupling": coupling}
        | {f"helmet.padding.{name}": value for name, value in padding.items()},
    )  # fmt: skip
    record = simulate(setup)
    turning = record.head_angular_acceleration
    assert np.abs(turning).max() < 2000.0  # 6600 and more, with another sign at every step
    assert np.abs(np.diff(turning, axis=0)).mean() < 50.0


@pytest.mark.parametrize(("coupling", "rates"), [("spring", "several"), ("foam", "single")])
def test_padding_that_is_as_stiff_as_metal_in_shear_is_resolved_by_the_step(coupling, rates):
    """A thin layer of soft padding that hardly shears, on a metal head: peaks at the default step
    are those of a ten times finer one (3180 and 9100 rad/s^2, where there are 225 and 6650, if its
    stiffness has no bound)."""

    def peak(step: float) -> float:
        setup = ImpactSetup(
            rig="headform", direction="top", normal_velocity=8.0, tangential_velocity=3.0,
            duration=0.01, time_step=step, rates=rates,
            overrides={"helmet.coupling": coupling, "helmet.padding.thickness": 1e-3,
                       "helmet.padding.modulus": 41e3, "helmet.padding.shear_modulus": 1e8,
                       "helmet.padding.relaxation": 0.01 if coupling == "foam" else 1e-3},
        )  # fmt: skip
        turning = simulate(setup).head_angular_acceleration
        return float(np.linalg.norm(turning, axis=1).max())

    assert peak(5e-5) == pytest.approx(peak(5e-6), rel=0.03)
