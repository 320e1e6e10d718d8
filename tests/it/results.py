"""Opens a results file as xarray users do: results.py RESULTS."""

import sys
import warnings

import numpy as np
import xarray

warnings.simplefilter("error")
with xarray.open_dataset(sys.argv[1]) as data:
    assert data.attrs["Conventions"] == "CF-1.11"
    for name in ("title", "source", "history", "references"):
        assert data.attrs.get(name), f"no global attribute {name}"
    t = data["t"]
    assert t.dims == ("t",) and t.dtype == np.float64, "time is a plain number, not a date"
    assert t.attrs["units"] == "s"
    assert np.all(np.diff(t.values) > 0), "times strictly increase"
    space = [name for name in data.coords if name in ("r", "x")]
    assert space, f"no coordinate r or x among {list(data.coords)}"
    for name, variable in data.variables.items():
        assert "units" in variable.attrs or variable.dtype.kind in "SUO" or name.endswith("_bnds"), f"{name}: no unit"
    profiles = [name for name in data.data_vars if set(data[name].dims) == {"t", space[0]}]
    assert profiles, "no profile over time"
    mean = data[profiles[0]].isel(t=-1)
    assert np.isfinite(mean.values).any()
