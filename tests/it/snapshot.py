"""Opens a snapshot as VTK, PyVista and h5py users do: snapshot.py SNAPSHOT SERIES."""

import json
import pathlib
import sys

import h5py
import numpy as np
import pyvista
import vtk
from vtk.util.numpy_support import vtk_to_numpy

path, series = sys.argv[1:]

with h5py.File(path) as file:
    ids = file["particles/id"][:]
    position = file["particles/position"][:]
    stress = file["particles/stress"][:]
count = len(ids)
assert count > 0
assert np.array_equal(ids, np.arange(count)), "rows in ascending id"
assert position.shape == (count, 3) and stress.shape == (count, 6)

messages = []
window = vtk.vtkOutputWindow()
window.AddObserver("ErrorEvent", lambda *_: messages.append("error"))
vtk.vtkOutputWindow.SetInstance(window)
reader = vtk.vtkHDFReader()
reader.AddObserver("ErrorEvent", lambda *_: messages.append("error"))
assert reader.CanReadFile(path)
reader.SetFileName(path)
reader.Update()
assert not messages, "VTK reports errors"
grid = reader.GetOutput()
assert grid.IsA("vtkUnstructuredGrid"), grid.GetClassName()
assert grid.GetNumberOfPoints() == grid.GetNumberOfCells() == count
assert np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), position)
for name, components in {"velocity": 3, "stress": 6, "id": 1, "density": 1, "mass": 1, "plastic_strain": 1}.items():
    array = grid.GetPointData().GetArray(name)
    assert array is not None, f"no array {name}"
    assert array.GetNumberOfTuples() == count and array.GetNumberOfComponents() == components, name
assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray("id")), ids)
assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray("stress")), stress)

mesh = pyvista.read(path)
assert mesh.n_points == count and mesh["velocity"].shape == (count, 3)
lower = mesh.clip("z", origin=position.mean(axis=0))
assert 0 < lower.n_points < count, "filters work on it"

entries = json.loads(pathlib.Path(series).read_text())
assert entries["file-series-version"] == "1.0"
times = [entry["time"] for entry in entries["files"]]
assert times == sorted(set(times)) and len(times) >= 2, times
for entry in entries["files"]:
    assert (pathlib.Path(series).parent / entry["name"]).is_file(), entry
