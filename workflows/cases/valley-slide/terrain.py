"""Makes the two rasters of this case: terrain.asc and release.asc. Standard library only; the same bytes everywhere.

A valley that bends, falls from 35 degrees to a fan of 3, and has a bank on its outer side; a slab of material near its head.
"""

from math import cos, exp, hypot, pi, sin, tanh
from pathlib import Path

CELLS, SIDE = 64, 4.0
CORNER = (648000.0, 5205000.0)  # of a zone of UTM


def ground(x, y):
    """Height, m: x and y from the south-western corner."""
    # Down along x: steep, then gentle.
    down = 78.0 * exp(-x / 95.0) + 0.05 * (256.0 - x)
    # The thalweg swings to both sides, and the valley opens where it is gentle.
    middle = 128.0 + 26.0 * sin(2.0 * pi * x / 230.0) * tanh(x / 60.0)
    width = 26.0 + 34.0 / (1.0 + exp(-(x - 165.0) / 14.0))
    away = abs(y - middle) / width
    sides = 20.0 * away * away / (1.0 + 0.35 * away * away)
    rough = 0.35 * sin(0.21 * x + 0.3) * cos(0.17 * y) + 0.25 * sin(0.45 * y - 0.1 * x)
    return 1500.0 + down + sides + rough


def release(x, y):
    """Thickness, m: a slab with a round rim."""
    middle = 128.0 + 26.0 * sin(2.0 * pi * x / 230.0) * tanh(x / 60.0)
    r = hypot((x - 34.0) / 20.0, (y - middle) / 17.0)
    return 6.0 * (1.0 - r * r) if r < 1.0 else 0.0


def write(name, field, digits):
    head = [f"ncols {CELLS}", f"nrows {CELLS}", f"xllcorner {CORNER[0]}", f"yllcorner {CORNER[1]}", f"cellsize {SIDE}"]
    rows = []
    for j in reversed(range(CELLS)):
        rows.append(" ".join(f"{field((i + 0.5) * SIDE, (j + 0.5) * SIDE):.{digits}f}" for i in range(CELLS)))
    text = "\n".join(head + ["nodata_value -9999"] + rows) + "\n"
    Path(__file__).with_name(name).write_text(text, encoding="ascii")


write("terrain.asc", ground, 2)
write("release.asc", release, 2)
