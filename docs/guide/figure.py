"""A figure for a paper from one or several runs: figure.py RUN.. -o figure.pdf

Surfaces at the end and run-out over time, one colour a run, in the width of a page. Needs xarray, netCDF4 and matplotlib.
Copy it and change it: everything that is drawn stands in post/results.nc with its unit.
"""

import argparse
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import xarray as xr

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("runs", nargs="+", type=pathlib.Path, metavar="RUN")
parser.add_argument("-o", "--output", default="figure.pdf")
arguments = parser.parse_args()

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "lines.linewidth": 1.2, "pdf.fonttype": 42})
figure, (surface, front) = plt.subplots(1, 2, figsize=(6.3, 2.4), layout="constrained")
colours = plt.get_cmap("viridis")
for number, run in enumerate(arguments.runs):
    with xr.open_dataset(run / "post/results.nc") as data:
        colour = colours(0.85 * number / max(len(arguments.runs) - 1, 1))
        along = "r" if "r" in data["height"].dims else "x"
        # Over the initial extent and sqrt(H0/g) where the scene has them, else in m and s.
        r0 = data["r0"].item() if "r0" in data else 1.0
        scale = data["time_scale"].item() if "time_scale" in data else 1.0
        end = data["height"].isel(t=-1)
        surface.plot(end[along] / r0, end.where(end > 0.0) / r0, color=colour, label=run.name)
        front.plot(data["t"] / scale, data["front_mass"] / r0, color=colour)
        lengths = ("/ r_0" if along == "r" else "/ L_0") if "r0" in data else r"\;(\mathrm{m})"
        times = "t / T" if "time_scale" in data else r"t\;(\mathrm{s})"
surface.set(xlabel=f"${along} {lengths}$", ylabel=f"$h {lengths}$", xlim=(0.0, None), ylim=(0.0, None), aspect="equal")
surface.legend(frameon=False, fontsize=7)
front.set(xlabel=f"${times}$", ylabel=f"front, ${along} {lengths}$", xlim=(0.0, None))
figure.savefig(arguments.output, metadata={"CreationDate": None} if arguments.output.endswith(".pdf") else None)
print(arguments.output)
