//! `[periodic]` of a scene: the axes along which it repeats itself.

use super::{
    check::AXES,
    fit::{REACH, is_whole},
    raw::{ANY, Table},
};
use crate::{space::Space, units::Dimension};

/// Both ends along each axis, m; None along those without a period, and where it has a fault.
pub(super) fn read(
    root: &Table<'_>,
    space: Option<Space>,
    spacing: Option<f64>,
    symmetry: [bool; 2],
    h_over_dx: f64,
) -> [Option<[f64; 2]>; 3] {
    let table = root.child("periodic");
    let mut periods = [None; 3];
    for (axis, key) in ["x", "y"].into_iter().enumerate() {
        let ends = table.child(key);
        if !ends.is_there() {
            continue;
        }
        let from = ends.needed("from", Dimension::Length, &ANY);
        let to = ends.needed("to", Dimension::Length, &ANY);
        let unfit = axis_fault(axis, space, symmetry);
        if let Some(message) = &unfit {
            ends.faults.add(ends.offset, &ends.path, message);
        } else if let (Some(from), Some(to), Some(dx)) = (&from, &to, spacing) {
            match length_fault(to.value - from.value, dx, h_over_dx) {
                Some(message) => ends.faults.at(to, message),
                None => periods[axis] = Some([from.value, to.value]),
            }
        }
        ends.finish();
    }
    table.finish();
    periods
}

fn axis_fault(axis: usize, space: Option<Space>, symmetry: [bool; 2]) -> Option<String> {
    let name = AXES[axis];
    match space {
        Some(Space::Axisymmetric) => Some("the space \"axisymmetric\" has no periodic axis".into()),
        Some(Space::PlaneStrain) if axis == 1 => Some("the space \"plane-strain\" has no y axis; valid: x".into()),
        _ if symmetry[axis] => {
            Some(format!("{name} = 0 is a plane of symmetry; drop \"{name}\" there, or this period"))
        }
        _ => None,
    }
}

fn length_fault(period: f64, dx: f64, h_over_dx: f64) -> Option<String> {
    let cells = period / dx;
    // A particle and its copy one period away must never both be in reach of a third.
    let least = 2.0 * REACH * h_over_dx;
    if period <= 0.0 {
        Some(format!("must be greater than `from`: the period is {period} m"))
    } else if cells <= least {
        Some(format!("the period is {cells} spacings; it must be more than {least:.2}, twice the reach of the kernel"))
    } else if !is_whole(period, dx) {
        Some(format!("the period must be a whole number of spacings; it is {cells} of {dx} m"))
    } else {
        None
    }
}
