//! The length of the next step, and the one reduction a step needs: it also carries every rank's health and every
//! request, so that all ranks decide alike.

use crate::error::Fault;
use crate::limits::Reason;
use crate::parallel::comm::Reduce;
use crate::physics::Physics;
use crate::simulation::Simulation;

/// Requests to all ranks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Requests {
    /// Stop after a checkpoint, and why.
    pub stop: Option<Reason>,
    /// Write a checkpoint.
    pub checkpoint: bool,
}

/// What the ranks agreed on.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Length of the step, s.
    pub time_step: f64,
    /// Time after the step, s.
    pub time: f64,
    /// No particle goes further in the step, m.
    pub farthest: f64,
    /// Will a particle have moved beyond what the neighbour lists allow?
    pub lists_go_stale: bool,
    pub requests: Requests,
}

/// Velocities beyond this many sound speeds are a fault.
const RUNAWAY: f64 = 20.0;

impl<const D: usize, const N: usize, P: Physics<D, N>> Simulation<'_, D, N, P> {
    /// Plans the step towards `event`, the next time at which something is due. Collective.
    ///
    /// dt = courant min(h/(c + |v|), sqrt(h/|a|)) over all particles (Yang et al. 2020, Eq 40, with the velocity and
    /// the force criterion of Monaghan 1992), at most viscous_courant rho0 h^2/mu_max (Szewc 2017, Eq 12), shortened to
    /// meet the event exactly.
    pub fn plan(&self, event: f64, requests: Requests) -> Result<Plan, Fault> {
        let (p, par) = (&self.particles, &self.parameters);
        let mut largest = [0.0_f64; 6];
        let [v2, a2, moved2, invalid, stop, checkpoint] = &mut largest;
        for i in 0..p.owned {
            let (v, a) = (p.v[i].norm2(), p.a[i].norm2());
            if !(v + a + p.density[i] + p.stress[i].trace()).is_finite() {
                *invalid = 1.0;
            }
            *v2 = v2.max(v);
            *a2 = a2.max(a);
            // No lists: they made room for the rows of a file.
            *moved2 = self.x_build.get(i).map_or(f64::INFINITY, |&built| moved2.max((p.x[i] - built).norm2()));
        }
        *stop = f64::from(requests.stop.map_or(0, Reason::code));
        *checkpoint = f64::from(u8::from(requests.checkpoint));
        self.comm.max(&mut largest);
        let [v2, a2, moved2, invalid, stop, checkpoint] = largest;

        let (v, a) = (v2.sqrt(), a2.sqrt());
        if invalid > 0.0 {
            return Err(Fault::NotFinite { step: self.clock.step });
        }
        if v > RUNAWAY * par.sound_speed {
            return Err(Fault::Runaway { step: self.clock.step, speed: v, sound_speed: par.sound_speed });
        }
        let acoustic = par.h / (par.sound_speed + v);
        let force = if a > 0.0 { (par.h / a).sqrt() } else { f64::INFINITY };
        let dt = (par.courant * acoustic.min(force)).min(par.viscous_step);
        if dt < 1e-6 * par.h / par.sound_speed {
            return Err(Fault::TimeStepVanishes { step: self.clock.step, time_step: dt });
        }
        let (time_step, time) = meet(self.clock.time, dt, event);
        // No particle goes further than |v| dt + |a| dt^2/2 before the lists are looked at again.
        let farthest = time_step * (v + 0.5 * a * time_step);
        let travel = moved2.sqrt() + farthest;
        Ok(Plan {
            time_step,
            time,
            farthest,
            lists_go_stale: travel > 0.5 * par.skin * (1.0 - 1e-9),
            requests: Requests { stop: Reason::from_code(stop as u8), checkpoint: checkpoint > 0.0 },
        })
    }
}

/// Shortens a step so that some step ends exactly at `event`, and all up to there are about as long: steps whose length changes in a
/// rhythm feed energy into waves that nothing damps.
fn meet(time: f64, dt: f64, event: f64) -> (f64, f64) {
    let left = event - time;
    let steps = (left / dt * (1.0 - 1e-9)).ceil();
    if steps <= 1.0 {
        return (left, event);
    }
    let step = if left.is_finite() { left / steps } else { dt };
    (step, time + step)
}

#[cfg(test)]
mod tests {
    use super::meet;

    #[test]
    fn steps_meet_the_event_exactly_and_are_alike() {
        for (dt, count) in [(0.3, 4), (0.251, 4), (0.25, 4), (0.2499, 5), (1.0, 1), (7.0, 1), (0.51, 2), (1e-3, 1000)] {
            let (mut time, mut steps) = (0.0, 0);
            while time < 1.0 {
                let (step, next) = meet(time, dt, 1.0);
                assert!((step * f64::from(count) - 1.0).abs() < 1e-9 && step <= dt * (1.0 + 2e-9), "{dt}: {step}");
                (time, steps) = (next, steps + 1);
            }
            assert_eq!((time, steps), (1.0, count), "{dt}");
        }
        assert_eq!(meet(0.25, 0.1, f64::INFINITY), (0.1, 0.35));
        // What is left decides anew at each step, so a limit that falls shortens the next one.
        assert_eq!(meet(0.25, 0.1, 1.0), (0.09375, 0.34375));
    }
}
