"""Exact signed distance from an ellipsoid, inside and outside."""

from __future__ import annotations

from helmet_sim_ros.model.compiled import compiled

NEAREST = 1e-100  # m, takes the place of a coordinate 0: the root below is then never on a pole
FLATTEST = 1e-9  # least det(I + d S), which vanishes where two nearest points meet


@compiled
def ellipsoid_form(
    x: float, y: float, z: float, a: float, b: float, c: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """The ``Form`` (see :mod:`.shapes`) of an ellipsoid with semi-axes a, b, c [m].

    The nearest point is p_i = a_i^2 x_i / (a_i^2 + t), with the largest t that puts it on the
    ellipsoid (Eberly, Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid,
    2013). The sum of squares falls and is convex in t, so Newton from its left side cannot
    overshoot. The second derivatives are S (I + d S)^-1 with S the shape operator at that point.
    """
    least = min(a, b, c)
    ka, kb, kc = (a - least) * (a + least), (b - least) * (b + least), (c - least) * (c + least)
    ax, ay, az = a * max(abs(x), NEAREST), b * max(abs(y), NEAREST), c * max(abs(z), NEAREST)
    s = max(ax - ka, ay - kb, az - kc)  # t + least^2: each term alone is at most 1
    for _ in range(50):
        ra, rb, rc = ax / (ka + s), ay / (kb + s), az / (kc + s)
        value = ra * ra + rb * rb + rc * rc - 1.0
        slope = ra * ra / (ka + s) + rb * rb / (kb + s) + rc * rc / (kc + s)
        step = 0.5 * value / slope
        s += step
        if step <= 1e-16 * s:
            break
    # Nearest point over semi-axis, with the length that rounding takes from it given back.
    ra, rb, rc = ax / (ka + s), ay / (kb + s), az / (kc + s)
    scale = 1.0 / (ra * ra + rb * rb + rc * rc) ** 0.5
    gx = (ra if x >= 0.0 else -ra) * scale / a
    gy = (rb if y >= 0.0 else -rb) * scale / b
    gz = (rc if z >= 0.0 else -rc) * scale / c
    g = (gx * gx + gy * gy + gz * gz) ** 0.5
    nx, ny, nz = gx / g, gy / g, gz / g
    d = (s - least * least) * g
    if abs(nz) < 0.9:
        length = 1.0 / (nx * nx + ny * ny) ** 0.5
        ex, ey, ez = -ny * length, nx * length, 0.0
    else:
        length = 1.0 / (ny * ny + nz * nz) ** 0.5
        ex, ey, ez = 0.0, -nz * length, ny * length
    fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
    ia, ib, ic = 1.0 / (a * a * g), 1.0 / (b * b * g), 1.0 / (c * c * g)
    s11 = ia * ex * ex + ib * ey * ey + ic * ez * ez
    s12 = ia * ex * fx + ib * ey * fy + ic * ez * fz
    s22 = ia * fx * fx + ib * fy * fy + ic * fz * fz
    det = max((1.0 + d * s11) * (1.0 + d * s22) - d * d * s12 * s12, FLATTEST)
    return (
        d, nx, ny, nz, ex, ey, ez,
        (s11 * (1.0 + d * s22) - d * s12 * s12) / det,
        s12 / det,
        (s22 * (1.0 + d * s11) - d * s12 * s12) / det,
    )  # fmt: skip
