//! The bits of the answer do not depend on the number of ranks, on how particles are shared out, on when checkpoints
//! are taken, or on being stopped, killed and resumed: row H5 of the list of verification tests, on the programs.

use formats::{exit, folder::RunFolder};
use std::fs;
use tests::trial::{Trial, hash, outputs, processes, short, signal, state, while_running};
use tests::{WorkFolder, left_out, prepared};

/// What the scenes share: soft ground, so that a few hundred steps see a flow.
const SHARED: &str = r#"
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0 Pa"

[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
"#;

/// A column that is thrown off its plane of symmetry against a smooth wall.
const PLANE: &str = r#"
space = "plane-strain"
spacing = "10 mm"
symmetry = ["x"]
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.3 m"] }
velocity = ["1 m/s", 0, 0]
[wall.side]
axis = "x"
at = "0.25 m"
side = "below"
slip = "free-slip"
[numerics]
courant = 0.6
[end]
time = "80 ms"
[output]
snapshots = "40 ms"
history = "4 ms"
"#;

/// A jittered column around the axis; the last interval of each output is shorter than the others.
const RINGS: &str = r#"
space = "axisymmetric"
spacing = "10 mm"
[body.column]
cylinder = { radius = "0.2 m", height = "0.2 m" }
velocity = ["0.5 m/s", 0, 0]
[initial]
jitter = 0.05
seed = 3
[end]
time = "85 ms"
[output]
snapshots = "40 ms"
history = "7 ms"
"#;

/// A quarter of a cylinder between two planes of symmetry.
const SOLID: &str = r#"
space = "3d"
spacing = "12.5 mm"
symmetry = ["x", "y"]
[body.column]
cylinder = { radius = "0.1 m", height = "0.15 m" }
velocity = ["0.8 m/s", "0.3 m/s", 0]
[numerics]
courant = 0.6
[end]
time = "80 ms"
[output]
snapshots = "40 ms"
history = "10 ms"
"#;

/// The mu(I) fluid with diffusion of its density and a viscosity on all pairs, thrown through its plane of symmetry.
const GRAINS: &str = r#"
space = "plane-strain"
spacing = "10 mm"
symmetry = ["x"]
[material.mu-i]
density = "1500 kg/m3"
sound-speed = "12 m/s"
friction-static = 0.38
friction-dynamic = 0.64
inertial-number = 0.279
grain-diameter = "2 mm"
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.3 m"] }
velocity = ["-0.5 m/s", 0, 0]
[initial]
jitter = 0.1
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[numerics]
density-diffusion = 0.1
viscosity-acts = "always"
[end]
time = "120 ms"
[output]
snapshots = "60 ms"
history = "7 ms"
"#;

/// Every stabiliser at once on cohesive ground whose particles cross two planes of symmetry.
const STABILISED: &str = r#"
space = "3d"
spacing = "12.5 mm"
symmetry = ["x", "y"]
[material.drucker-prager]
density = "2600 kg/m3"
young = "0.4 MPa"
poisson = 0.3
friction = "25 deg"
cohesion = "0.5 kPa"
mean-stress = "density"
rotation = "hughes-winget"
[body.column]
cylinder = { radius = "0.1 m", height = "0.125 m" }
velocity = ["-0.8 m/s", "-0.3 m/s", 0]
[initial]
jitter = 0.15
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[numerics]
stress-diffusion = 0.1
gradient-correction = "variational"
artificial-stress = 0.3
quadratic-viscosity = 1
shifting = 0.5
[end]
time = "100 ms"
[output]
snapshots = "50 ms"
history = "10 ms"
"#;

/// The visco-plastic fluid, its viscosity between pairs, against a smooth wall.
const FLUID: &str = r#"
space = "plane-strain"
spacing = "10 mm"
symmetry = ["x"]
[kernel]
kind = "wendland-c2"
[material.visco-plastic]
density = "1850 kg/m3"
sound-speed = "12 m/s"
friction = "20 deg"
cohesion = "0.1 kPa"
viscosity = "0.5 Pa s"
viscosity-solid = "50 Pa s"
operator = "harmonic"
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.25 m"] }
velocity = ["-0.3 m/s", 0, 0]
[initial]
stress = "hydrostatic"
jitter = 0.1
[wall.floor]
axis = "z"
at = "0 m"
side = "above"
slip = "no-slip"
[wall.side]
axis = "x"
at = "0.25 m"
side = "below"
slip = "free-slip"
[numerics]
density-diffusion = 0.05
shifting = 0.2
[end]
time = "120 ms"
[output]
snapshots = "60 ms"
history = "7 ms"
"#;

/// A column on a floor that slides, with wind from the left: it leaves at one end and comes in at the other.
const PERIOD: &str = r#"
space = "plane-strain"
spacing = "10 mm"
periodic = { x = { from = "-0.07 m", to = "0.23 m" } }
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.15 m"] }
velocity = ["1.5 m/s", 0, 0]
[initial]
jitter = 0.05
[numerics]
courant = 0.6
[end]
time = "80 ms"
[output]
snapshots = "40 ms"
history = "4 ms"
"#;

/// A column that is thrown into the corner of two mirror walls, one rough, one smooth.
const CORNER: &str = r#"
space = "plane-strain"
spacing = "10 mm"
symmetry = ["x"]
[body.column]
box = { min = [0, 0, 0], max = ["0.2 m", 0, "0.3 m"] }
velocity = ["1 m/s", 0, 0]
[wall.side]
axis = "x"
at = "0.25 m"
side = "below"
slip = "free-slip"
kind = "mirror"
[numerics]
courant = 0.6
[end]
time = "80 ms"
[output]
snapshots = "40 ms"
history = "4 ms"
"#;

/// A slab between a plane of symmetry and a mirror wall so near that images have images, periodic along y.
const SLAB: &str = r#"
space = "3d"
spacing = "12.5 mm"
symmetry = ["x"]
periodic = { y = { from = "-0.025 m", to = "0.125 m" } }
[body.column]
box = { min = [0, 0, 0], max = ["0.05 m", "0.1 m", "0.2 m"] }
velocity = [0, "1.2 m/s", 0]
[wall.side]
axis = "x"
at = "0.05 m"
side = "below"
slip = "no-slip"
kind = "mirror"
velocity = [0, 0, "0.4 m/s"]
[initial]
jitter = 0.05
[numerics]
courant = 0.6
[end]
time = "80 ms"
[output]
snapshots = "40 ms"
history = "10 ms"
"#;

fn scene(text: &str) -> String {
    format!("{text}{SHARED}")
}

/// The same with the pairs in f32.
fn mixed(text: &str) -> String {
    let key = "[numerics]\nprecision = \"mixed\"\n";
    if text.contains("[numerics]\n") { text.replace("[numerics]\n", key) } else { format!("{text}{key}") }
}

/// On more ranks, from preparation on; on three of them with particles shared out anew at every build of the lists
/// and checkpoints at odd moments.
fn on_other_ranks(trial: &Trial, scene: &str) {
    on_three_ranks(trial, scene);
    for ranks in [2, 5] {
        on_ranks(trial, scene, ranks, &[]);
    }
}

/// The hardest of it, for what a scene has on top of its space: two and five ranks go on with it in [`in_pieces`].
fn on_three_ranks(trial: &Trial, scene: &str) {
    on_ranks(trial, scene, 3, &["--always-rebalance", "--checkpoint-every", "37steps"]);
}

fn on_ranks(trial: &Trial, scene: &str, ranks: usize, habits: &[&str]) {
    let folder = prepared(&trial.work, &format!("ranks-{ranks}"), scene, ranks);
    let digest = |folder: &RunFolder| formats::snapshot::digest(&folder.initial()).unwrap();
    assert_eq!(digest(&trial.reference), digest(&folder), "initial.hdf of {ranks} ranks");
    assert_eq!(hash(&trial.reference.initial()), hash(&folder.initial()), "initial.hdf of {ranks} ranks");
    trial.go(&folder, ranks, habits, exit::DONE);
    trial.same(&folder);
}

/// Stopped again and again, and resumed on other numbers of ranks.
fn in_pieces(trial: &Trial) {
    let folder = trial.fresh("pieces");
    for (ranks, steps) in [(1, "0"), (1, "41"), (3, "1"), (2, "57")] {
        trial.go(&folder, ranks, &["--stop-after-steps", steps], exit::RESUMABLE);
        assert!(!folder.done().exists());
    }
    let resumed = trial.go(&folder, 5, &[], exit::DONE);
    assert!(resumed.stderr.contains("step 99"), "{resumed}");
    trial.same(&folder);
}

/// One rank is killed after the second checkpoint; resumed on another number of ranks.
fn after_a_kill(trial: &Trial) {
    let folder = trial.fresh("killed");
    let output = while_running(&folder, 3, |folder| {
        let ranks = processes(folder.path(), "sph-run");
        signal("KILL", ranks[ranks.len() / 2]);
    });
    assert!(!output.timed_out && output.code != exit::DONE && output.code != exit::RESUMABLE, "{output}");
    assert!(!folder.done().exists());
    let resumed = trial.go(&folder, 2, &[], exit::DONE);
    assert!(resumed.stderr.contains("resuming"), "{resumed}");
    trial.same(&folder);
}

/// Once more after the end: nothing happens.
fn after_the_end(trial: &Trial) {
    let before = state(trial.reference.path());
    trial.go(&trial.reference, 3, &[], exit::DONE);
    assert_eq!(before, state(trial.reference.path()));
    trial.go(&trial.reference, 2, &["--new"], exit::USAGE);
    assert_eq!(before, state(trial.reference.path()));
}

/// Killed between the last checkpoint and the mark that the run is done.
fn without_the_last_mark(trial: &Trial) {
    fs::remove_file(trial.reference.done()).unwrap();
    let before = outputs(&trial.reference);
    trial.go(&trial.reference, 2, &[], exit::DONE);
    assert!(trial.reference.done().exists());
    assert_eq!(before, outputs(&trial.reference));
}

#[test]
fn plane_strain() {
    let text = scene(PLANE);
    let trial = Trial::new(&text);
    on_other_ranks(&trial, &text);
    in_pieces(&trial);
    after_a_kill(&trial);
    after_the_end(&trial);
    without_the_last_mark(&trial);
}

#[test]
fn axisymmetric() {
    let text = scene(RINGS);
    let trial = Trial::new(&text);
    on_other_ranks(&trial, &text);
    in_pieces(&trial);
    after_a_kill(&trial);
}

#[test]
fn three_d() {
    let text = scene(SOLID);
    let trial = Trial::new(&text);
    on_other_ranks(&trial, &text);
    in_pieces(&trial);
    after_a_kill(&trial);
}

#[test]
fn mu_i() {
    let trial = Trial::new(GRAINS);
    on_three_ranks(&trial, GRAINS);
    in_pieces(&trial);
}

#[test]
fn stabilised() {
    let trial = Trial::new(STABILISED);
    on_three_ranks(&trial, STABILISED);
    in_pieces(&trial);
}

#[test]
fn visco_plastic() {
    let trial = Trial::new(FLUID);
    on_three_ranks(&trial, FLUID);
    in_pieces(&trial);
}

#[test]
fn periodic() {
    let text = scene(PERIOD).replace("slip = \"no-slip\"", "slip = \"no-slip\"\nvelocity = [\"0.5 m/s\", 0, 0]");
    let trial = Trial::new(&text);
    on_three_ranks(&trial, &text);
    in_pieces(&trial);
    after_a_kill(&trial);
}

#[test]
fn between_mirror_walls() {
    let text = scene(CORNER).replace("slip = \"no-slip\"", "slip = \"no-slip\"\nkind = \"mirror\"");
    let trial = Trial::new(&text);
    on_three_ranks(&trial, &text);
    in_pieces(&trial);
}

#[test]
fn slab_of_mirrors_and_periods() {
    let text = scene(SLAB);
    let trial = Trial::new(&text);
    on_three_ranks(&trial, &text);
    in_pieces(&trial);
}

/// Pairs in f32: with the plain operators and with the corrected ones, and beside walls of both kinds. A period takes f64.
#[test]
fn mixed_precision() {
    let corner = scene(CORNER).replace("slip = \"no-slip\"", "slip = \"no-slip\"\nkind = \"mirror\"");
    for text in [scene(SOLID), scene(RINGS), STABILISED.to_owned(), corner] {
        let text = mixed(&text);
        let trial = Trial::new(&text);
        on_ranks(&trial, &text, 2, &[]);
        on_three_ranks(&trial, &text);
        in_pieces(&trial);
    }
}

/// What the levels of `--instructions` ask of a processor.
#[cfg(target_arch = "x86_64")]
fn processor_has(level: &str) -> bool {
    use std::arch::is_x86_feature_detected as has;
    match level {
        "avx512" => has!("avx512f") && has!("avx512bw") && has!("avx512cd") && has!("avx512dq") && has!("avx512vl"),
        "avx2" => has!("avx2") && has!("fma"),
        _ => true,
    }
}
#[cfg(not(target_arch = "x86_64"))]
fn processor_has(level: &str) -> bool {
    level == "portable"
}

/// Lanes of 64 bytes, of 32, and one particle at a time; block by block in f64 and in f32.
#[test]
fn with_all_instructions() {
    for text in [short::SOLID, short::RINGS] {
        let answers = [text.to_owned(), mixed(text)].map(|text| {
            let trial = Trial::in_memory(&text);
            for level in ["avx512", "avx2", "portable"] {
                for ranks in [1, 2] {
                    let folder = trial.fresh(&format!("{level}-{ranks}"));
                    let options = ["--instructions", level];
                    if processor_has(level) {
                        let said = trial.go(&folder, ranks, &options, exit::DONE);
                        let name = ["AVX-512", "AVX2", "portable"].into_iter().find(|name| said.stderr.contains(name));
                        assert_eq!(name.map(|name| name.replace('-', "").to_lowercase()).as_deref(), Some(level));
                        trial.same(&folder);
                    } else {
                        let said = trial.go(&folder, ranks, &options, exit::USAGE);
                        assert_eq!(said.stderr.matches("the processor has no").count(), 1, "{said}");
                        left_out(&format!("the processor has no {level}"));
                    }
                }
            }
            tests::digests(&trial.reference).pop()
        });
        assert_ne!(answers[0], answers[1], "f32 is not f64");
    }
}

/// By a signal to mpirun, by one to a single rank, by a file: exit code 75, and the same command goes on.
#[test]
fn stopped_on_request() {
    let trial = Trial::new(&scene(RINGS));
    let folder = trial.fresh("stopped");
    let to_mpirun = |folder: &RunFolder| signal("USR1", processes(folder.path(), "mpirun")[0]);
    while_running(&folder, 2, to_mpirun).expect(exit::RESUMABLE);
    trial.go(&folder, 3, &[], exit::DONE);
    trial.same(&folder);

    let folder = trial.fresh("one-rank");
    let to_one = |folder: &RunFolder| signal("TERM", *processes(folder.path(), "sph-run").last().unwrap());
    while_running(&folder, 3, to_one).expect(exit::RESUMABLE);
    trial.go(&folder, 1, &[], exit::DONE);
    trial.same(&folder);

    // A file is looked for twice a second: a run that takes longer than that.
    let longer = scene(&RINGS.replace("85 ms", "2 s").replace("7 ms", "0.5 s").replace("40 ms", "1 s"));
    let folder = prepared(&trial.work, "file", &longer, 2);
    while_running(&folder, 2, |folder| fs::write(folder.stop(), "").unwrap()).expect(exit::RESUMABLE);
    assert!(!folder.stop().exists(), "the request is honoured once");
    trial.go(&folder, 2, &["--stop-after-steps", "1"], exit::RESUMABLE);
}

/// A run that ends at rest ends there also when it was killed before it was marked as done.
#[test]
fn at_rest() {
    let damped =
        RINGS.replace("[end]", "[numerics]\ndamping = \"20 1/s\"\ndamping-in-flow = \"forced\"\n[end]\nat-rest = 0.5");
    let work = WorkFolder::new();
    let reference = tests::computed(&work, "one", &scene(&damped), 1);
    let history = fs::read_to_string(reference.history()).unwrap();
    assert!((3..15).contains(&history.lines().count()), "it should come to rest before its end time:\n{history}");
    let trial = Trial { work, reference };
    without_the_last_mark(&trial);
}
