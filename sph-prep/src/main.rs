//! `sph-prep`: from a scene to particles. See [`sph_prep::run`].

fn main() {
    std::process::exit(sph_prep::run(std::env::args_os()));
}
