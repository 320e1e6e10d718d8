//! `sph-post`: from snapshots to numbers and pictures. See [`sph_post::run`].

fn main() {
    std::process::exit(sph_post::run(std::env::args_os()));
}
