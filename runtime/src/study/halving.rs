//! Successive halving: many candidates are measured briefly, the better half for longer, until one is left (Karnin, Koren and Somekh
//! 2013; Jamieson and Talwalkar 2016).

use crate::error::Error;

/// What was found out about a candidate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Its cost, as measured last and longest; `None` if it was not.
    pub cost: Option<f64>,
    /// How often it was measured: those that last are measured most often.
    pub rounds: u32,
}

/// Seconds on a clock, and what is measured with it.
pub trait Bench {
    /// Seconds since the beginning.
    fn elapsed(&self) -> f64;
    /// Measures a candidate for about so many seconds; `None` if it cannot run.
    ///
    /// # Errors
    /// When nothing more can be measured.
    fn measure(&mut self, candidate: usize, seconds: f64) -> Result<Option<f64>, Error>;
    /// Whether to go on.
    fn goes_on(&self) -> bool;
}

/// Measures candidates within a budget of seconds, each round of halving with an equal part of it.
///
/// # Errors
/// As `Bench::measure`.
pub fn halve(count: usize, budget: f64, bench: &mut dyn Bench) -> Result<Vec<Standing>, Error> {
    let mut standings = vec![Standing::default(); count];
    let mut alive: Vec<usize> = (0..count).collect();
    while !alive.is_empty() {
        let rounds = f64::from(alive.len().next_power_of_two().ilog2().max(1));
        let end = bench.elapsed() + (budget - bench.elapsed()) / rounds;
        for (place, &candidate) in alive.iter().enumerate() {
            let left = end - bench.elapsed();
            if bench.elapsed() >= budget || !bench.goes_on() {
                return Ok(standings);
            }
            let cost = bench.measure(candidate, left.max(0.0) / (alive.len() - place) as f64)?;
            standings[candidate] = Standing { cost, rounds: standings[candidate].rounds + 1 };
        }
        if alive.len() == 1 {
            break;
        }
        alive.retain(|&candidate| standings[candidate].cost.is_some());
        alive.sort_by(|&a, &b| cost(&standings[a]).total_cmp(&cost(&standings[b])));
        alive.truncate(alive.len().div_ceil(2));
        if alive.len() == 1 {
            break;
        }
    }
    Ok(standings)
}

/// The candidate that lasted longest, of those the one of least cost; `None` when none could be measured.
pub fn winner(standings: &[Standing]) -> Option<usize> {
    let measured = (0..standings.len()).filter(|&index| standings[index].cost.is_some());
    measured.min_by(|&a, &b| {
        let longer = standings[b].rounds.cmp(&standings[a].rounds);
        longer.then(cost(&standings[a]).total_cmp(&cost(&standings[b])))
    })
}

fn cost(standing: &Standing) -> f64 {
    standing.cost.unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Candidates of known costs; a measurement takes as long as it may, and is off by a tenth over the root of its seconds.
    struct Known {
        costs: Vec<Option<f64>>,
        clock: f64,
        calls: Vec<(usize, f64)>,
    }

    impl Bench for Known {
        fn elapsed(&self) -> f64 {
            self.clock
        }

        fn measure(&mut self, candidate: usize, seconds: f64) -> Result<Option<f64>, Error> {
            self.clock += seconds.max(0.01);
            self.calls.push((candidate, seconds));
            let sign = if self.calls.len().is_multiple_of(2) { 1.0 } else { -1.0 };
            let off = 1.0 + sign * 0.1 / seconds.max(1.0).sqrt();
            Ok(self.costs[candidate].map(|cost| cost * off))
        }

        fn goes_on(&self) -> bool {
            true
        }
    }

    fn halved(costs: &[Option<f64>], budget: f64) -> (Vec<Standing>, Known) {
        let mut bench = Known { costs: costs.to_vec(), clock: 0.0, calls: Vec::new() };
        let standings = halve(costs.len(), budget, &mut bench).unwrap_or_default();
        (standings, bench)
    }

    #[test]
    fn the_best_lasts_longest_and_the_budget_is_kept() {
        let costs: Vec<Option<f64>> = [9.0, 4.0, 8.0, 3.0, 7.0, 5.0, 6.0, 10.0].map(Some).to_vec();
        let (standings, bench) = halved(&costs, 80.0);
        assert_eq!(winner(&standings), Some(3));
        let rounds: Vec<u32> = standings.iter().map(|standing| standing.rounds).collect();
        assert_eq!((rounds.iter().sum::<u32>(), rounds[3]), (8 + 4 + 2, 3));
        assert!((bench.clock - 80.0).abs() < 1e-6, "{}", bench.clock);
        assert!(bench.calls[12].1 > 3.0 * bench.calls[0].1, "the last are measured for longer");
    }

    #[test]
    fn who_cannot_run_drops_out() {
        let (standings, _) = halved(&[None, Some(2.0), None], 3.0);
        assert_eq!((winner(&standings), standings[0].cost), (Some(1), None));
        assert_eq!(winner(&halved(&[None, None], 3.0).0), None);
        assert_eq!(winner(&halved(&[], 3.0).0), None);
        assert_eq!(winner(&halved(&[Some(1.0)], 3.0).0), Some(0));
    }

    #[test]
    fn a_spent_budget_leaves_candidates_unmeasured() {
        let (standings, _) = halved(&[Some(2.0), Some(1.0), Some(3.0)], 0.015);
        let measured = standings.iter().filter(|standing| standing.cost.is_some()).count();
        assert_eq!((measured, winner(&standings)), (2, Some(1)));
    }
}
