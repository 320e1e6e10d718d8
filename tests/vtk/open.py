"""Opens particle files with VTK alone, and compares what it reads with the file: open.py FILE..."""

import sys

import h5py
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy


def check(path):
    """Fails unless VTK finds every field of the file, number by number."""
    errors = []
    reader = vtk.vtkHDFReader()
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    assert reader.CanReadFile(path), f"{path}: VTK says that it is none of its files"
    reader.SetFileName(path)
    reader.Update()
    assert not errors, f"{path}: VTK reports errors"
    grid = reader.GetOutput()
    with h5py.File(path) as file:
        count = len(file["particles/id"])
        assert grid.GetNumberOfPoints() == grid.GetNumberOfCells() == count > 0, path
        assert np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), file["particles/position"][:]), path
        names = [name for name in file["VTKHDF/PointData"]]
        assert {"velocity", "stress", "density", "id"} <= set(names), names
        for name in names:
            array = grid.GetPointData().GetArray(name)
            assert array is not None, f"{path}: VTK does not find {name}"
            assert np.array_equal(vtk_to_numpy(array), file["VTKHDF/PointData"][name][:], equal_nan=True), f"{path}: {name}"
    return len(names)


window = vtk.vtkOutputWindow()
vtk.vtkOutputWindow.SetInstance(window)
fields = [check(path) for path in sys.argv[1:]]
print(f"VTK {vtk.vtkVersion.GetVTKVersion()}: {len(fields)} files, {sum(fields)} fields, all as they are")
