"""Makes the solids of this case: houses.stl and wall.stl, on the terrain of ../valley-slide. Standard library only; the same bytes
everywhere.

Three houses with gabled roofs, and a wall that is to turn the slide away from one of them. Both are text files in metres, in the
coordinates of the scene, and reach into the ground.
"""

from math import cos, radians, sin
from pathlib import Path

HERE = Path(__file__).parent
ORIGIN = 1500.0  # height of z = 0
FOUNDATION = 3.0  # below the lowest ground that they stand on


def terrain():
    lines = (HERE / "../valley-slide/terrain.asc").read_text(encoding="ascii").split("\n")
    side = float(lines[4].split()[1])
    rows = [[float(z) for z in line.split()] for line in lines[6:] if line]
    return side, rows[::-1]


SIDE, ROWS = terrain()


def ground(x, y):
    """Height in the scene: bilinear between the middles of cells."""
    u, v = x / SIDE - 0.5, y / SIDE - 0.5
    i, j = int(u), int(v)
    s, t = u - i, v - j
    z = [(1 - s) * ROWS[k][i] + s * ROWS[k][i + 1] for k in (j, j + 1)]
    return (1 - t) * z[0] + t * z[1] - ORIGIN


def placed(centre, angle, points):
    """Points given along and across, and by height, as points of the scene."""
    c, s = cos(radians(angle)), sin(radians(angle))
    return [(centre[0] + c * u - s * v, centre[1] + s * u + c * v, z) for u, v, z in points]


def prism(section, length, centre, angle):
    """A convex section (across, height), counter-clockwise, drawn out along the angle."""
    ends = [placed(centre, angle, [(side * 0.5 * length, v, z) for v, z in section]) for side in (-1, 1)]
    back, front = ends
    n = len(section)
    triangles = [(front[0], front[k], front[k + 1]) for k in range(1, n - 1)]
    triangles += [(back[0], back[k + 1], back[k]) for k in range(1, n - 1)]
    for k in range(n):
        m = (k + 1) % n
        triangles += [(back[k], back[m], front[m]), (back[k], front[m], front[k])]
    return triangles


def on_the_ground(half, length, centre, angle):
    """The height of the foundation below a rectangle, and of the ground in its middle."""
    corners = [(u * 0.5 * length, v * half, 0.0) for u in (-1, 0, 1) for v in (-1, 0, 1)]
    heights = [ground(x, y) for x, y, _ in placed(centre, angle, corners)]
    return min(heights) - FOUNDATION, ground(*centre)


def house(centre, angle, length=11.0, width=8.0, walls=5.0, ridge=8.0):
    half = 0.5 * width
    foot, top = on_the_ground(half, length, centre, angle)
    section = [(-half, foot), (half, foot), (half, top + walls), (0.0, top + ridge), (-half, top + walls)]
    return prism(section, length, centre, angle)


def wall(centre, angle, length=34.0, thickness=3.0, height=5.0):
    half = 0.5 * thickness
    foot, top = on_the_ground(half, length, centre, angle)
    section = [(-half, foot), (half, foot), (half, top + height), (-half, top + height)]
    return prism(section, length, centre, angle)


def write(name, triangles):
    lines = ["solid made by houses.py"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:.4f} {y:.4f} {z:.4f}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    lines += ["endsolid", ""]
    (HERE / name).write_text("\n".join(lines), encoding="ascii")


write("houses.stl", house((140.0, 121.0), -40.0) + house((153.0, 101.0), -20.0) + house((172.0, 104.0), 10.0))
write("wall.stl", wall((126.0, 112.0), 65.0, length=26.0))
