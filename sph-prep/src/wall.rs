//! How many virtual wall particles the run starts with.

use formats::{
    scene::{Scene, WallLattice},
    snapshot::Rows,
};
use mpi::{
    collective::SystemOperation,
    datatype::{Partition, PartitionMut},
    traits::*,
};
use std::collections::HashSet;

/// Number of wall sites within the kernel's reach of a particle, those across planes of symmetry left out; the same
/// on any number of ranks. Collective.
pub fn within_reach(scene: &Scene, rows: &Rows, comm: &impl Communicator) -> u64 {
    let mine = distinct(exchange(&sites(scene, rows), comm));
    let mut total = 0;
    comm.all_reduce_into(&mine, &mut total, SystemOperation::sum());
    total
}

/// Numbers of the sites near these particles, each once.
fn sites(scene: &Scene, rows: &Rows) -> Vec<u64> {
    let lattice = WallLattice::new(scene);
    let reach = 2.0 * scene.h();
    // The axis of the axisymmetric space is one more border that nothing lies across.
    let axis = scene.space == formats::space::Space::Axisymmetric;
    let border = [scene.symmetry[0] || axis, scene.symmetry[1]];
    let mut found = HashSet::new();
    for &x in &rows.position {
        lattice.near(x, reach, |site| {
            found.insert(site);
        });
    }
    let kept = |x: [f64; 3]| (0..2).all(|axis| !border[axis] || x[axis] > 0.0);
    found.into_iter().filter(|site| kept(lattice.position(*site))).map(WallLattice::id).collect()
}

/// Sends every site to the one rank that counts it, since particles of several ranks may be near it.
fn exchange(sites: &[u64], comm: &impl Communicator) -> Vec<u64> {
    let size = comm.size() as usize;
    let mut parcels = vec![Vec::new(); size];
    for &site in sites {
        parcels[(site % size as u64) as usize].push(site);
    }
    let sent: Vec<i32> = parcels.iter().map(|p| p.len() as i32).collect();
    let mut received = vec![0; size];
    comm.all_to_all_into(&sent[..], &mut received[..]);
    let offsets = |counts: &[i32]| {
        let sum = |at: &mut i32, count: &i32| Some(std::mem::replace(at, *at + count));
        counts.iter().scan(0, sum).collect::<Vec<i32>>()
    };
    let (from, to) = (offsets(&sent), offsets(&received));
    let outgoing = parcels.concat();
    let mut incoming = vec![0u64; received.iter().sum::<i32>() as usize];
    let partition = Partition::new(&outgoing[..], &sent[..], &from[..]);
    comm.all_to_all_varcount_into(&partition, &mut PartitionMut::new(&mut incoming[..], &received[..], &to[..]));
    incoming
}

fn distinct(mut sites: Vec<u64>) -> u64 {
    sites.sort_unstable();
    sites.dedup();
    sites.len() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fill, testing::scene};
    use formats::{
        scene::{Shape, Slip, Wall},
        space::Space,
    };

    #[test]
    fn a_floor_has_its_layers_under_the_body_and_a_margin() {
        let shape = Shape::Box { min: [0.0; 3], max: [0.1, 0.0, 0.05] };
        let mut scene = scene(Space::PlaneStrain, 0.01, shape);
        scene.walls.push(Wall { axis: 2, at: 0.0, side: 1.0, slip: Slip::NoSlip });
        let rows = fill::serial(&scene);
        // Reach 2.4 dx: under the bottom row lie sites 1 and 2 layers down (1 dx and 2 dx away), two more to each side
        // in the first layer (sqrt 5 dx), one in the second.
        assert_eq!(distinct(sites(&scene, &rows)), 10 + 10 + 2 * 2 + 2);
        scene.symmetry[0] = true;
        assert_eq!(distinct(sites(&scene, &rows)), 10 + 10 + 2 + 1);
        scene.walls.clear();
        assert_eq!(distinct(sites(&scene, &rows)), 0);
    }
}
