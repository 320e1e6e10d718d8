from spack_repo.builtin.build_systems.cargo import CargoPackage

from spack.package import *

PROGRAMS = ("sph-prep", "sph-run", "sph-post")
PACKAGES = [word for program in PROGRAMS for word in ("--package", program)]


class Talus(CargoPackage):
    """Granular flows by smoothed particle hydrodynamics on MPI: the programs sph-prep, sph-run and sph-post."""

    license("MIT OR Apache-2.0")

    # Without a URL: the source is the tree this recipe lies in, see `develop` in packaging/spack/spack.yaml.
    version("0.1.0")

    depends_on("c", type="build")
    depends_on("rust@1.90:", type="build")
    depends_on("llvm+clang", type="build")  # its libclang reads mpi.h for the bindings
    depends_on("mpi")
    depends_on("hdf5@1.10:1.14+mpi+shared")
    depends_on("netcdf-c@4.7:+mpi+shared")

    # For --test=root: the tests of the packages. Those of the whole (./talus test) need Slurm and Python.
    check_args = ["--release", "--locked", "--package", "formats", *PACKAGES]

    sanity_check_is_file = [f"bin/{program}" for program in PROGRAMS]

    def setup_build_environment(self, env: EnvironmentModifications) -> None:
        # .cargo/config.toml has those of Debian for where they are not set.
        env.set("HDF5_DIR", self.spec["hdf5"].prefix)
        env.set("NETCDF_DIR", self.spec["netcdf-c"].prefix)
        env.set("MPICC", self.spec["mpi"].mpicc)
        env.set("LIBCLANG_PATH", self.spec["llvm"].prefix.lib)
        # What is installed comes from target/ below, not from a folder set in the caller's shell.
        env.unset("CARGO_TARGET_DIR")
        env.unset("RUSTFLAGS")

    def build(self, spec: Spec, prefix: Prefix) -> None:
        # Not `cargo install`, as CargoPackage has it: there is a workspace, which has no program at its root.
        cargo("build", "--release", "--locked", "-j", str(make_jobs), *PACKAGES)

    def install(self, spec: Spec, prefix: Prefix) -> None:
        mkdirp(prefix.bin)
        for program in PROGRAMS:
            install(join_path("target", "release", program), prefix.bin)
