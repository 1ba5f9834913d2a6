//! What the kernels of a pass count.

use crate::error::Error;
use serde::Serialize;

/// What the kernels counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Camera rays.
    pub primary: u64,
    /// Rays after the first scattering.
    pub secondary: u64,
    /// Later rays of walks.
    pub deep: u64,
    /// Shadow and connection rays.
    pub visibility: u64,
    /// Contributions refused by the film: not finite, or negative.
    pub rejected: u64,
    /// Records that found no room in a stream or queue.
    pub overflow: u64,
    /// Paths alive after the last round.
    pub unfinished: u64,
}

impl Counters {
    /// The counter of a name of `Plan::counters`.
    pub fn slot(&mut self, name: &str) -> Option<&mut u64> {
        Some(match name {
            "rays_primary" => &mut self.primary,
            "rays_secondary" => &mut self.secondary,
            "rays_deep" => &mut self.deep,
            "rays_visibility" => &mut self.visibility,
            "rejected" => &mut self.rejected,
            "overflow" => &mut self.overflow,
            "unfinished" => &mut self.unfinished,
            _ => return None,
        })
    }

    /// Adds another pass.
    pub fn add(&mut self, other: &Counters) {
        self.primary += other.primary;
        self.secondary += other.secondary;
        self.deep += other.deep;
        self.visibility += other.visibility;
        self.rejected += other.rejected;
        self.overflow += other.overflow;
        self.unfinished += other.unfinished;
    }

    /// Whether everything that was found reached the film.
    ///
    /// # Errors
    /// Failed, when records or paths were lost: the picture would be wrong.
    pub fn refuse_losses(&self) -> Result<(), Error> {
        if self.overflow > 0 {
            let lost = self.overflow;
            return Err(Error::failed(format!(
                "a stream overflowed: {lost} records were lost in one pass, so the picture would be wrong"
            )));
        }
        if self.unfinished > 0 {
            let left = self.unfinished;
            return Err(Error::failed(format!(
                "{left} paths were still alive after the last round: the pipeline's `rounds` is too small"
            )));
        }
        Ok(())
    }
}
