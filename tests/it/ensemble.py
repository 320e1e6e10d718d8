"""An analysis of an ensemble as xarray users do it, held against the numbers of sph-post: ensemble.py RUN RUN.."""

import json
import pathlib
import sys
import warnings

import numpy as np
import xarray as xr

warnings.simplefilter("error")
# Of dask's own scheduler, not of our files.
warnings.filterwarnings("ignore", category=DeprecationWarning, module="dask")
runs = [pathlib.Path(run) for run in sys.argv[1:]]
summaries = [json.loads((run / "post/summary.json").read_text()) for run in runs]
member = xr.DataArray([run.name for run in runs], dims="member", name="member")


def opened(name):
    """One file of every member, along a dimension `member`; radii that one lacks are missing there."""
    files = [run / "post" / name for run in runs]
    together = dict(data_vars="all", coords="minimal", compat="override", join="outer", combine_attrs="drop_conflicts")
    return xr.open_mfdataset(files, combine="nested", concat_dim=member, **together)


def same(name, ours, theirs, tolerance=1e-12):
    """Fails unless the numbers agree, member by member."""
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    assert ours.shape == theirs.shape and np.all(np.isfinite(ours)), f"{name}: {ours} {theirs}"
    error = np.max(np.abs(ours - theirs) / np.maximum(np.abs(theirs), 1e-300))
    assert error <= tolerance, f"{name}: {ours}, sph-post has {theirs}"


def last(name):
    return [summary[name] for summary in summaries]


results, history = opened("results.nc"), opened("history.nc")
assert results.sizes["member"] == history.sizes["member"] == len(runs) >= 2
assert results.attrs["Conventions"] == "CF-1.11" and results["t"].attrs["units"] == "s"
dx, r0 = results["dx"].isel(member=0).item(), results["r0"].isel(member=0).item()

# Volume of the deposit: thickness over the rings, against that of the particles.
edges = results["r_bnds"].isel(member=0) if "member" in results["r_bnds"].dims else results["r_bnds"]
rings = np.pi * (results["r"] + 0.5 * dx) ** 2 - np.pi * (results["r"] - 0.5 * dx) ** 2
same("rings", np.pi * (edges.isel(bnds=1) ** 2 - edges.isel(bnds=0) ** 2).dropna("r"), rings[: edges.sizes["r"]], 1e-9)
volume = (results["thickness"].fillna(0.0) * rings).sum("r")
start = np.pi * r0**2 * results["height_0"]
same("volume", (volume / start).isel(t=-1), last("volume_ratio"), 1e-9)
same("volume over time", volume / start, results["volume_ratio"], 1e-9)

# Heights.
height = results["height"].fillna(0.0)
same("height", height.where(results["r"] <= 2.0 * dx).max("r").isel(t=-1), last("final_height_m"))
same("highest", height.max("r").isel(t=-1), last("max_height_m"))

# The front of the deposit: outward from the ring with most volume, the first bin thinner than half a spacing, of which the part
# counts that its content fills half a spacing high. Beyond the furthest particle there is none.
thickness = results["thickness"].fillna(0.0).load().pad(r=(0, 1), constant_values=0.0)
thickness = thickness.assign_coords(r=(np.arange(thickness.sizes["r"]) + 0.5) * dx)
bulk = (thickness.isel(r=slice(-1)) * rings.values).idxmax("r")
edge = thickness["r"].where((thickness["r"] >= bulk) & (thickness < 0.5 * dx)).min("r")
front = edge - 0.5 * dx + thickness.sel(r=edge, method="nearest") / 0.5
same("front", np.minimum(front, results["front_furthest"]), results["front_thickness"], 1e-9)
for kind in ("furthest", "mass", "thickness"):
    runout = (results[f"front_{kind}"] - r0) / r0
    same(kind, runout, results[f"runout_{kind}"], 1e-9)
same("run-out", ((results["front_mass"] - r0) / r0).isel(t=-1), last("runout_mass_99_5"), 1e-9)

# What the floor carries, from the stresses over the rings.
force = (results["basal_normal_stress"].fillna(0.0) * rings).sum("r")
same("force", force, results["basal_force"], 1e-9)
same("force over weight", (-force / results["weight_above"]).isel(t=-1), last("basal_force_over_weight"), 1e-9)

# Energies: the history is finer than the snapshots and has the same numbers where both have them.
energies = ["kinetic_energy", "potential_energy", "elastic_energy"]
there = history[energies].sel(t=results["t"], method="nearest", tolerance=1e-12)
for name in energies:
    scale = float(abs(history["potential_energy"]).max())
    error = np.abs(there[name].values - results[name].values).max()
    assert error < 1e-9 * scale, f"{name}: {error}"
same("at rest", history["kinetic_energy"].isel(t=-1) / history["kinetic_energy"].max("t"), last("kinetic_over_peak"))
lost = history["plastic_work"].isel(t=-1) + history["viscous_work"].isel(t=-1)
potential = history["potential_energy"].isel(t=0)
same("dissipated", lost / potential, last("dissipated_share"), 1e-9)
total = history[energies + ["plastic_work", "viscous_work"]].to_dataarray("part").sum("part")
drop = abs(history["potential_energy"] - history["potential_energy"].isel(t=0)).max("t")
closure = ((total - total.isel(t=0)) / drop).isel(t=-1)
assert np.allclose(closure, last("energy_closure"), rtol=0.0, atol=1e-9), closure.values
same("peak speed", history["max_speed"].max("t"), last("peak_speed_m_s"))

# Over the ensemble.
spread = results["runout_mass"].isel(t=-1)
mean, deviation = float(spread.mean("member")), float(spread.std("member"))
assert np.isclose(mean, np.mean(last("runout_mass_99_5"))) and deviation > 0.0, (mean, deviation)
print(f"run-out {mean:.4f} +- {deviation:.4f} over {len(runs)} members")
