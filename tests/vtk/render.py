"""Particles by speed, read and drawn by VTK without a screen: render.py SNAPSHOT... -o PICTURE.png [--beside OURS.png]

Positions and velocities come from vtkHDFReader; what the labels say (title, time, spacing, space) comes from h5py. With --beside
the picture of `sph-post` is put above. Needs vtk, h5py and numpy, libXrender, and EGL or OSMesa where there is no X server.
"""

import argparse
import math

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

COLUMNS = 2
PANEL_WIDTH = 660
LEFT, RIGHT, TOP, BOTTOM, GAP_X, GAP_Y = 120, 190, 115, 84, 40, 46  # pixels around and between the panels
FONT = 22
INK, PALE = (0.13, 0.13, 0.13), (0.90, 0.90, 0.90)
# viridis at eleven even steps; straight lines between them.
VIRIDIS = "440154 482475 414487 355f8d 2a788e 21918c 22a884 44bf70 7ad151 bddf26 fde725".split()


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("snapshots", nargs="+", metavar="SNAPSHOT")
    parser.add_argument("-o", "--output", required=True, metavar="PICTURE.png")
    parser.add_argument("--beside", metavar="OURS.png")
    return parser.parse_args()


def read(path):
    """The particles of one file with their speed, and what is to be written above them."""
    errors = []
    reader = vtk.vtkHDFReader()
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    if not reader.CanReadFile(path):
        raise SystemExit(f"{path}: VTK says that it is none of its files")
    reader.SetFileName(path)
    reader.Update()
    grid = vtk.vtkUnstructuredGrid()
    grid.ShallowCopy(reader.GetOutput())
    velocity = grid.GetPointData().GetArray("velocity")
    if errors or velocity is None or not grid.GetNumberOfPoints():
        raise SystemExit(f"{path}: VTK finds no particles with a velocity in it")
    speed = numpy_to_vtk(np.linalg.norm(vtk_to_numpy(velocity), axis=1), deep=True)
    speed.SetName("speed")
    grid.GetPointData().AddArray(speed)
    with h5py.File(path) as file:
        facts = dict(file["sph"].attrs)
    return grid, {key: value.decode() if isinstance(value, bytes) else value for key, value in facts.items()}


def shades(fastest):
    table = vtk.vtkColorTransferFunction()
    for number, colour in enumerate(VIRIDIS):
        red, green, blue = (int(colour[at : at + 2], 16) / 255 for at in (0, 2, 4))
        table.AddRGBPoint(fastest * number / (len(VIRIDIS) - 1), red, green, blue)
    return table


def squares(grid, spacing, table, mirrored):
    """A square of the particles' spacing for each; a little larger, so that neighbours touch."""
    square = vtk.vtkPlaneSource()
    half = 0.53 * spacing
    square.SetOrigin(-half, 0, -half)
    square.SetPoint1(half, 0, -half)
    square.SetPoint2(-half, 0, half)
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(grid)
    mapper.SetSourceConnection(square.GetOutputPort())
    mapper.ScalingOff()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("speed")
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    if mirrored:
        actor.SetScale(-1, 1, 1)
    return actor


def line(start, end, colour):
    source = vtk.vtkLineSource()
    source.SetPoint1(*start)
    source.SetPoint2(*end)
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*colour)
    actor.GetProperty().LightingOff()
    actor.GetProperty().SetLineWidth(2)
    return actor


def text(words, at, size=FONT, centred=False, right=False):
    actor = vtk.vtkTextActor()
    actor.SetInput(words)
    actor.SetPosition(*at)
    style = actor.GetTextProperty()
    style.SetFontFamilyToArial()
    style.SetFontSize(size)
    style.SetColor(*INK)
    style.SetVerticalJustificationToCentered()
    if centred:
        style.SetJustificationToCentered()
    if right:
        style.SetJustificationToRight()
    return actor


def frame_of(pictures):
    """What all panels show, in m: the bounds of all snapshots, on both sides of an axis of symmetry."""
    spacing = pictures[0][1]["spacing"]
    bounds = np.array([grid.GetBounds() for grid, _ in pictures])
    x = [bounds[:, 0].min(), bounds[:, 1].max()]
    if is_ring(pictures[0][1]):
        x[0] = -x[1]
    z = [bounds[:, 4].min(), bounds[:, 5].max()]
    return np.array(x) + np.array([-2, 2]) * spacing, np.array(z) + np.array([-0.5, 2]) * spacing


def is_ring(facts):
    return facts["space"] == "axisymmetric"


def marks(ends, most):
    """Even numbers along an axis; 1, 2 or 5 times a power of ten apart, at most so many parts."""
    length = ends[1] - ends[0]
    power = 10.0 ** math.floor(math.log10(length / most))
    step = next(step * power for step in (1, 2, 5, 10) if step * power * most >= length * (1 - 1e-9))
    return np.arange(math.ceil(ends[0] / step), math.floor(ends[1] / step) + 1) * step


def number(value):
    return f"{value:.4g}".replace("-", "\u2212")


def draw(pictures):
    """All snapshots in panels of the same scale, beside one bar of colours."""
    x, z = frame_of(pictures)
    fastest = max(grid.GetPointData().GetArray("speed").GetRange()[1] for grid, _ in pictures) or 1.0
    table = shades(fastest)
    panel = PANEL_WIDTH, round(PANEL_WIDTH * (z[1] - z[0]) / (x[1] - x[0]))
    rows = math.ceil(len(pictures) / COLUMNS)
    size = LEFT + COLUMNS * (panel[0] + GAP_X) - GAP_X + RIGHT, TOP + rows * (panel[1] + GAP_Y) - GAP_Y + BOTTOM
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    sheet = vtk.vtkRenderer()
    sheet.SetBackground(1, 1, 1)
    window.AddRenderer(sheet)
    title = f"{pictures[0][1]['title']}: speed, read and drawn by VTK {vtk.vtkVersion.GetVTKVersion()}"
    sheet.AddViewProp(text(title, (20, size[1] - 28), FONT + 4))
    for at, (grid, facts) in enumerate(pictures):
        row, column = divmod(at, COLUMNS)
        corner = LEFT + column * (panel[0] + GAP_X), size[1] - TOP - row * (panel[1] + GAP_Y) - panel[1]
        window.AddRenderer(section(grid, facts, table, (x, z), corner, panel, size))
        label(sheet, facts, (x, z), corner, panel, column == 0, at + COLUMNS >= len(pictures))
    draw_bar(sheet, table, fastest, size)
    window.Render()
    taken = vtk.vtkWindowToImageFilter()
    taken.SetInput(window)
    taken.ReadFrontBufferOff()
    taken.Update()
    return taken.GetOutput()


def section(grid, facts, table, ends, corner, panel, size):
    """The particles of one snapshot seen along y, in a part of the window."""
    x, z = ends
    view = vtk.vtkRenderer()
    view.SetBackground(1, 1, 1)
    far = corner[0] + panel[0], corner[1] + panel[1]
    view.SetViewport(corner[0] / size[0], corner[1] / size[1], far[0] / size[0], far[1] / size[1])
    for mark in marks(x, 8):
        view.AddActor(line((mark, 1, z[0]), (mark, 1, z[1]), PALE))
    for mark in marks(z, 2):
        view.AddActor(line((x[0], 1, mark), (x[1], 1, mark), PALE))
    for mirrored in (False, True) if is_ring(facts) else (False,):
        view.AddActor(squares(grid, facts["spacing"], table, mirrored))
    pixel = (x[1] - x[0]) / panel[0]
    left, right, low, high = x[0] + pixel, x[1] - pixel, z[0] + pixel, z[1] - pixel
    corners = [(left, -1, low), (right, -1, low), (right, -1, high), (left, -1, high)]
    for start, end in zip(corners, corners[1:] + corners[:1]):
        view.AddActor(line(start, end, INK))
    camera = view.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(x.mean(), 0, z.mean())
    camera.SetPosition(x.mean(), -10, z.mean())
    camera.SetViewUp(0, 0, 1)
    camera.SetParallelScale((z[1] - z[0]) / 2)
    view.ResetCameraClippingRange()
    return view


def label(sheet, facts, ends, corner, panel, first, last):
    """The time above a panel; numbers and names at the outer axes."""
    x, z = ends
    pixel = (x[1] - x[0]) / panel[0]
    left, low = corner
    sheet.AddViewProp(text(f"t = {facts['time']:.4g} s", (left, low + panel[1] + 17)))
    if first:
        for mark in marks(z, 2):
            sheet.AddViewProp(text(number(mark), (left - 10, low + (mark - z[0]) / pixel), right=True))
        sheet.AddViewProp(text("z (m)", (14, low + panel[1] / 2)))
    if last:
        for mark in marks(x, 8):
            sheet.AddViewProp(text(number(mark), (left + (mark - x[0]) / pixel, low - 19), centred=True))
        name = "r (m)" if is_ring(facts) else "x (m)"
        sheet.AddViewProp(text(name, (left + panel[0] / 2, low - 52), centred=True))


def draw_bar(sheet, table, fastest, size):
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetNumberOfLabels(0)
    bar.SetMaximumNumberOfColors(256)
    bar.SetTitle("")
    bar.SetBarRatio(1.0)
    bar.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    left, low, height = size[0] - RIGHT + 40, BOTTOM, size[1] - TOP - BOTTOM - 16
    bar.SetPosition(left / size[0], low / size[1])
    bar.SetWidth(22 / size[0])
    bar.SetHeight(height / size[1])
    sheet.AddViewProp(bar)
    sheet.AddViewProp(text("speed (m/s)", (left - 6, low + height + 24)))
    for mark in marks((0.0, fastest), 5):
        sheet.AddViewProp(text(number(mark), (left + 34, low + height * mark / fastest)))


def below(upper_path, lower):
    """Our picture above VTK's, on white, both of the same width."""
    reader = vtk.vtkPNGReader()
    reader.SetFileName(upper_path)
    flat = vtk.vtkImageExtractComponents()
    flat.SetInputConnection(reader.GetOutputPort())
    flat.SetComponents(0, 1, 2)
    flat.Update()
    wide = lower.GetDimensions()[0]
    ours = flat.GetOutput().GetDimensions()
    fitted = vtk.vtkImageResize()
    fitted.SetInputConnection(flat.GetOutputPort())
    fitted.SetOutputDimensions(wide, round(ours[1] * wide / ours[0]), 1)
    both = vtk.vtkImageAppend()
    both.SetAppendAxis(1)
    both.AddInputData(lower)
    both.AddInputConnection(fitted.GetOutputPort())
    both.Update()
    return both.GetOutput()


def main():
    arguments = parse()
    picture = draw([read(path) for path in arguments.snapshots])
    if arguments.beside:
        picture = below(arguments.beside, picture)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(arguments.output)
    writer.SetInputData(picture)
    writer.Write()
    print(arguments.output)


if __name__ == "__main__":
    main()
