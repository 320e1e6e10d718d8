//! Courant numbers a scene may ask for.

use formats::scene::Scene;

/// The message on the Courant number, if there is one.
fn refused(space: &str, kernel: &str, correction: &str, courant: f64) -> Option<String> {
    let text = format!(
        "space = \"{space}\"\nspacing = 0.01\n[kernel]\nkind = \"{kernel}\"\n[material.drucker-prager]\ndensity = 2600\n\
         young = 1e6\npoisson = 0.3\nfriction = 30\ncohesion = 0\n[body.block]\n\
         box = {{ min = [0, 0, 0], max = [0.1, 0.1, 0.1] }}\n[numerics]\ngradient-correction = \"{correction}\"\n\
         courant = {courant}\n[end]\ntime = 1\n"
    );
    let error = Scene::read("scene.toml", &text).err()?;
    let [fault] = error.faults.as_slice() else { panic!("one fault is expected: {error}") };
    assert_eq!(fault.key, "numerics.courant");
    Some(fault.message.clone())
}

/// Corrected gradients lower the limit; rings at the axis lower it more, corrected or not.
#[test]
fn corrected_gradients_need_shorter_steps() {
    for space in ["plane-strain", "3d"] {
        for kernel in ["cubic-spline", "wendland-c2"] {
            assert_eq!(refused(space, kernel, "none", 1.7), None);
            assert_eq!(refused(space, kernel, "variational", 0.84), None);
            let message = refused(space, kernel, "variational", 0.85).expect("too long");
            assert!(message.contains("(0, 0.84]") && message.contains("corrected gradients"), "{message}");
        }
    }
    for correction in ["none", "variational"] {
        assert_eq!(refused("axisymmetric", "cubic-spline", correction, 0.69), None);
        let message = refused("axisymmetric", "cubic-spline", correction, 0.7).expect("too long");
        assert!(message.contains("(0, 0.69]") && message.contains("hoop"), "{message}");
    }
}
