"""Writes the crates of Cargo.lock, with their checksums, into the easyconfig: crates.py; crates.py --check only compares."""

import pathlib
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
BEGIN, END = "# Cargo.lock: begin\n", "# Cargo.lock: end\n"


def listing(lock, version):
    """The two lists as EasyBuild wants them; what has no source is our own."""
    crates = sorted((p["name"], p["version"], p["checksum"]) for p in lock["package"] if "source" in p)
    lines = ["crates = [\n"]
    lines += [f"    ('{name}', '{number}'),\n" for name, number, _ in crates]
    # Without one for the archive of the tree that this file is part of.
    lines += ["]\n", "checksums = [\n", f"    {{'talus-{version}.tar.gz': None}},\n"]
    lines += [f"    {{'{name}-{number}.tar.gz': '{checksum}'}},\n" for name, number, checksum in crates]
    return "".join(lines + ["]\n"])


def main():
    (path,) = HERE.glob("Talus-*.eb")
    text = path.read_text()
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    version = path.name.split("-")[1]
    lock = tomllib.loads((HERE / "../../Cargo.lock").read_text())
    new = before + BEGIN + listing(lock, version) + END + after
    if "--check" in sys.argv[1:]:
        sys.exit(0 if new == text else f"{path.name} has other crates than Cargo.lock: run packaging/easybuild/crates.py")
    path.write_text(new)


main()
