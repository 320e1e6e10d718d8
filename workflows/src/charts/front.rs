//! Which points are on the front of error and cost, and which of the others are no worse as far as can be told.

/// A point with its scatter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Cost, and its standard deviation.
    pub cost: [f64; 2],
    /// Error, and its standard deviation.
    pub error: [f64; 2],
}

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rank {
    /// No other point has both less error and less cost: a Pareto optimum.
    Front,
    /// Those that are better in one and not worse in the other are so by less than the scatter.
    Near,
    /// Some point is better by more than the scatter.
    Behind,
}

impl Rank {
    /// For tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Front => "**front**",
            Self::Near => "next to it",
            Self::Behind => "dominated",
        }
    }
}

/// The rank of every point. Points of equal cost and equal error are all on the front. One combined standard deviation is the root of
/// the sum of the squares of the two: what differs by less is not sold as a difference.
pub fn ranks(places: &[Place]) -> Vec<Rank> {
    let beaten_by = |i: usize| (0..places.len()).filter(move |&j| dominates(&places[j], &places[i]));
    let is_front: Vec<bool> = (0..places.len()).map(|i| beaten_by(i).next().is_none()).collect();
    let rank = |i: usize| match is_front[i] {
        true => Rank::Front,
        false if beaten_by(i).any(|j| is_front[j] && clearly(&places[j], &places[i])) => Rank::Behind,
        false => Rank::Near,
    };
    (0..places.len()).map(rank).collect()
}

/// Which points of the front are more accurate than a cheaper one of it by no more than the scatter.
pub fn levels(places: &[Place], ranks: &[Rank]) -> Vec<bool> {
    let on_front = |i: &usize| ranks[*i] == Rank::Front;
    let as_good = |i: usize, j: usize| {
        let (a, b) = (places[j], places[i]);
        a.cost[0] < b.cost[0] && a.error[0] - b.error[0] <= a.error[1].hypot(b.error[1])
    };
    (0..places.len()).map(|i| on_front(&i) && (0..places.len()).filter(on_front).any(|j| as_good(i, j))).collect()
}

/// Not worse in both, better in one.
fn dominates(a: &Place, b: &Place) -> bool {
    let (cost, error) = ([a.cost[0], b.cost[0]], [a.error[0], b.error[0]]);
    cost[0] <= cost[1] && error[0] <= error[1] && (cost[0] < cost[1] || error[0] < error[1])
}

/// Better in one by more than the scatter of both; `a` dominates `b`.
fn clearly(a: &Place, b: &Place) -> bool {
    let beyond = |a: [f64; 2], b: [f64; 2]| b[0] - a[0] > a[1].hypot(b[1]);
    beyond(a.cost, b.cost) || beyond(a.error, b.error)
}

#[cfg(test)]
mod tests {
    use super::{Rank::*, *};

    fn place(cost: f64, error: f64, scatter: f64) -> Place {
        Place { cost: [cost, 0.0], error: [error, scatter] }
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let places = [(1.0, 8.0), (2.0, 9.0), (3.0, 4.0), (4.0, 4.0), (5.0, 1.0), (9.0, 7.0)];
        let found = ranks(&places.map(|(cost, error)| place(cost, error, 0.0)));
        assert_eq!(found, [Front, Behind, Front, Behind, Front, Behind]);
        assert_eq!(ranks(&[]), []);
    }

    #[test]
    fn ties_are_all_on_the_front() {
        assert_eq!(ranks(&[place(1.0, 2.0, 0.0), place(1.0, 2.0, 0.5), place(1.0, 3.0, 0.0)]), [Front, Front, Behind]);
    }

    #[test]
    fn what_differs_by_less_than_the_scatter_is_next_to_the_front() {
        let better = Place { cost: [1.0, 0.05], error: [2.0, 0.3] };
        let rank = |cost: f64, error: f64| ranks(&[better, Place { cost: [cost, 0.05], error: [error, 0.4] }])[1];
        // One combined standard deviation is 0.5 in error and 0.0707 in cost.
        assert_eq!(rank(1.05, 2.49), Near);
        assert_eq!(rank(1.05, 2.51), Behind);
        // As good, and clearly dearer.
        assert_eq!(rank(1.08, 2.0), Behind);
        assert_eq!(rank(0.5, 9.0), Front);
        // The other way round: dearer, and more accurate by less or by more than that.
        let level = |error: f64| {
            let places = [better, Place { cost: [3.0, 0.0], error: [error, 0.4] }];
            levels(&places, &ranks(&places))
        };
        assert_eq!((level(1.51), level(1.49)), (vec![false, true], vec![false, false]));
    }
}
