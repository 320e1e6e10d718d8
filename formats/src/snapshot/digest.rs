//! Digests of the numbers of a particle file, one a field, which do not depend on who holds which rows.
//!
//! The digest of a field is the sum, modulo 2^128, of a hash of every row with its number (XXH3, 128 bits). So ranks add
//! theirs up, whatever rows they have, and the same comes out of memory before writing and of the file afterwards.

use super::{Column, Header, Rows, fields_of};
use crate::h5::Communicator;
use crate::provenance::hex;
use crate::schema::Kept;
use mpi::collective::SystemOperation;
use mpi::traits::CommunicatorCollectives;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use xxhash_rust::xxh3::xxh3_128;

/// The digest of each field, by its name: 32 hexadecimal digits.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Digests(pub BTreeMap<String, String>);

impl Digests {
    /// One digest for a whole file: SHA-256 of what its header says and of the fields' digests.
    pub fn of_file(&self, header: &Header) -> String {
        let mut hash = Sha256::new();
        hash.update(header.bytes());
        for (name, digest) in &self.0 {
            hash.update(format!("{name}={digest}\n"));
        }
        hex(&hash.finalize())
    }

    /// Names of the fields that differ from `other`'s, or that only one of them has.
    pub fn different<'a>(&'a self, other: &'a Self) -> Vec<&'a str> {
        let names = self.0.keys().chain(other.0.keys().filter(|name| !self.0.contains_key(*name)));
        names.filter(|name| self.0.get(*name) != other.0.get(*name)).map(String::as_str).collect()
    }
}

/// The digests while rows are added to them.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    kept: Kept,
    /// In the order of the fields.
    sums: Vec<u128>,
}

impl Sums {
    /// Of no rows.
    pub(super) fn new(kept: Kept) -> Self {
        Self { kept, sums: vec![0; fields_of(kept).count()] }
    }

    /// Adds rows. Their columns must be complete.
    pub(super) fn add(&mut self, rows: &Rows) {
        for (field, sum) in fields_of(self.kept).zip(&mut self.sums) {
            let width = field.rank.components();
            match rows.column(field) {
                Column::Whole(values) => add_column(sum, rows.first, width, values, |value| value.to_le_bytes()),
                Column::Real(values) => add_column(sum, rows.first, width, values, |value| value.to_le_bytes()),
            }
        }
    }

    /// The digests of this process's rows.
    pub(super) fn finish(self) -> Digests {
        let name = |text: &str| text.to_owned();
        Digests(fields_of(self.kept).zip(self.sums).map(|(f, sum)| (name(f.name), format!("{sum:032x}"))).collect())
    }

    /// Collective: the digests of all ranks' rows together, the same on all.
    pub(super) fn finish_together(mut self, comm: &Communicator) -> Digests {
        // Quarters of 32 bits in 64: sums over fewer than 2^32 ranks do not overflow.
        let quarters = |sum: u128| [0, 32, 64, 96].map(|shift| u64::from((sum >> shift) as u32));
        let mine: Vec<u64> = self.sums.iter().flat_map(|&sum| quarters(sum)).collect();
        let mut all = vec![0u64; mine.len()];
        comm.all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
        for (sum, quarters) in self.sums.iter_mut().zip(all.chunks_exact(4)) {
            *sum = quarters.iter().rev().fold(0u128, |sum, &quarter| (sum << 32).wrapping_add(u128::from(quarter)));
        }
        self.finish()
    }
}

fn add_column<T: Copy>(sum: &mut u128, first: u64, width: usize, values: &[T], bytes: impl Fn(T) -> [u8; 8]) {
    let mut row = [0u8; 8 * 7];
    for (number, values) in (first..).zip(values.chunks_exact(width)) {
        row[..8].copy_from_slice(&number.to_le_bytes());
        for (place, &value) in row[8..].chunks_exact_mut(8).zip(values) {
            place.copy_from_slice(&bytes(value));
        }
        *sum = sum.wrapping_add(xxh3_128(&row[..8 * (1 + width)]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot::share;

    /// Rows of a range, made from their numbers alone.
    fn rows(range: std::ops::Range<u64>) -> Rows {
        let ids: Vec<u64> = range.clone().collect();
        let real = |salt: f64| ids.iter().map(|&id| (id as f64 + salt).sin()).collect::<Vec<f64>>();
        Rows {
            first: range.start,
            body: vec![0; ids.len()],
            position: real(1.0).into_iter().map(|x| [x, -0.0, x]).collect(),
            velocity: vec![[0.0; 3]; ids.len()],
            acceleration: vec![[0.0; 3]; ids.len()],
            mass: real(2.0),
            density: real(3.0),
            stress: real(4.0).into_iter().map(|s| [s; 6]).collect(),
            stress_work: real(5.0),
            viscous_work: real(6.0),
            plastic_strain: real(7.0),
            id: ids,
        }
    }

    fn sums(ranges: impl IntoIterator<Item = std::ops::Range<u64>>) -> Digests {
        let mut sums = Sums::new(Kept::Checkpoint);
        ranges.into_iter().for_each(|range| sums.add(&rows(range)));
        sums.finish()
    }

    #[test]
    fn who_holds_which_rows_does_not_matter() {
        let whole = sums(std::iter::once(0..100));
        for size in [2, 3, 7] {
            assert_eq!(sums((0..size).rev().map(|rank| share(100, rank, size))), whole);
        }
        assert_ne!(sums(std::iter::once(0..99)), whole);
    }

    #[test]
    fn every_change_shows_in_its_field_alone() {
        let whole = sums(std::iter::once(0..100));
        let changed = |change: fn(&mut Rows)| {
            let (mut sums, mut rows) = (Sums::new(Kept::Checkpoint), rows(0..100));
            change(&mut rows);
            sums.add(&rows);
            let digests = sums.finish();
            digests.different(&whole).join(",")
        };
        assert_eq!(changed(|_| {}), "");
        assert_eq!(changed(|rows| rows.position[41][1] = 0.0), "position");
        assert_eq!(changed(|rows| rows.mass.swap(3, 4)), "mass");
        assert_eq!(changed(|rows| rows.body[99] = 1), "body");
        assert_eq!(changed(|rows| rows.stress[7][5] = f64::from_bits(rows.stress[7][5].to_bits() ^ 1)), "stress");
    }
}
