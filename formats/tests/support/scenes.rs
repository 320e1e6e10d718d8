//! Scenes with one piece replaced: what they become, or the one fault they have.
#![allow(dead_code, reason = "each test binary uses its own part")]

use formats::scene::{Fault, Scene};

pub fn faults(text: &str) -> Vec<Fault> {
    match Scene::read("scene.toml", text) {
        Ok(scene) => panic!("no fault was found: {scene:?}"),
        Err(error) => error.faults,
    }
}

/// `scene` with one piece replaced has exactly one fault, at the `line` and `column`, with that phrase.
#[track_caller]
pub fn bad(scene: &str, from: &str, to: &str, place: (usize, usize), key: &str, phrase: &str) {
    assert_eq!(scene.matches(from).count(), 1, "{from}");
    let faults = faults(&scene.replace(from, to));
    let [fault] = faults.as_slice() else { panic!("one fault is expected: {faults:#?}") };
    assert_eq!((fault.line, fault.column), place, "{fault:?}");
    assert_eq!(fault.key, key, "{fault:?}");
    assert!(fault.message.contains(phrase), "{fault:?}");
}

#[track_caller]
pub fn good(scene: &str, from: &str, to: &str) -> Scene {
    assert_eq!(scene.matches(from).count(), 1, "{from}");
    Scene::read("scene.toml", &scene.replace(from, to)).unwrap_or_else(|error| panic!("{error}"))
}
