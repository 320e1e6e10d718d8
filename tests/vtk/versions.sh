#!/bin/sh
# Opens every kind of particle file with several versions of VTK: versions.sh WORK FILE..., WORK being a folder for their
# environments. Needs python3 with venv, and the package index; a version takes about 300 MB. Prints a line each and ends with 1
# where one fails. Not part of ./talus test, which has one version: see docs/guide/tools.md for what came out.
set -u
[ $# -ge 2 ] || { sed -n '2,4s/^# //p' "$0" >&2; exit 2; }
work=$1
shift
here=$(dirname "$0")
failed=0
for version in ${VTK_VERSIONS:-9.2.6 9.3.1 9.4.2 9.5.2 9.6.2 9.7.2}; do
    env="$work/vtk-$version"
    if [ ! -f "$env/READY" ]; then
        # The newest numpy breaks the oldest of them, which do not say so.
        case $version in 9.2.* | 9.3.*) numpy='numpy<2' ;; *) numpy=numpy ;; esac
        python3 -m venv "$env" && "$env/bin/pip" install --quiet "vtk==$version" h5py "$numpy" && : >"$env/READY"
    fi
    if "$env/bin/python" "$here/open.py" "$@"; then :; else failed=1; echo "VTK $version: FAILED"; fi
done
exit $failed
