//! Alias tables: picks an entry with a given probability in constant time.
//!
//! Walker 1977, with the construction of Vose, *A Linear Algorithm for Generating Random Numbers with a Given Distribution*, 1991.

/// One entry: it is picked itself below the threshold, its alias above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// In [0, 1].
    pub threshold: f32,
    /// Another entry.
    pub alias: u32,
}

/// Probabilities in proportion to the weights; all zero when the weights are.
pub fn probabilities(weights: &[f64]) -> Vec<f64> {
    let total = sum(weights);
    weights.iter().map(|&weight| if total > 0.0 { weight / total } else { 0.0 }).collect()
}

/// Sum with the error of each addition carried along (Neumaier 1974): a million texels must add up to one.
pub fn sum(values: &[f64]) -> f64 {
    let (mut total, mut lost) = (0.0f64, 0.0f64);
    for &value in values {
        let next = total + value;
        lost += if total.abs() >= value.abs() { (total - next) + value } else { (value - next) + total };
        total = next;
    }
    total + lost
}

/// The table of a distribution whose probabilities add up to one. Entries of probability 0 are never picked.
pub fn table(probabilities: &[f64]) -> Vec<Entry> {
    let count = probabilities.len();
    let likeliest = (0..count).max_by(|&a, &b| probabilities[a].total_cmp(&probabilities[b])).unwrap_or(0);
    let mut scaled: Vec<f64> = probabilities.iter().map(|p| p * count as f64).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|&i| scaled[i] < 1.0);
    let mut entries = vec![Entry { threshold: 1.0, alias: 0 }; count];
    while let (Some(&poor), Some(&rich)) = (small.last(), large.last()) {
        small.pop();
        entries[poor] = Entry { threshold: scaled[poor] as f32, alias: rich as u32 };
        scaled[rich] -= 1.0 - scaled[poor];
        if scaled[rich] < 1.0 {
            large.pop();
            small.push(rich);
        }
    }
    // What is left is full up to rounding, except entries that must not be picked at all.
    for i in small.into_iter().chain(large) {
        let threshold = if probabilities[i] > 0.0 { 1.0 } else { 0.0 };
        entries[i] = Entry { threshold, alias: likeliest as u32 };
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picked(entries: &[Entry]) -> Vec<f64> {
        let mut out = vec![0.0; entries.len()];
        for (i, entry) in entries.iter().enumerate() {
            out[i] += f64::from(entry.threshold) / entries.len() as f64;
            out[entry.alias as usize] += (1.0 - f64::from(entry.threshold)) / entries.len() as f64;
        }
        out
    }

    #[test]
    fn table_reproduces_its_probabilities() {
        let weights: Vec<f64> =
            (0..1000).map(|i| if i % 7 == 0 { 0.0 } else { f64::from(i * i % 113) + 1e-9 }).collect();
        let probabilities = probabilities(&weights);
        assert!((sum(&probabilities) - 1.0).abs() < 1e-14);
        for (p, q) in probabilities.iter().zip(picked(&table(&probabilities))) {
            assert!((p - q).abs() < 1e-9, "{p} {q}");
            assert!(*p > 0.0 || q == 0.0, "picked an entry of probability 0");
        }
    }

    #[test]
    fn extremes() {
        assert!(table(&[]).is_empty());
        assert_eq!(probabilities(&[0.0, 0.0]), [0.0, 0.0]);
        assert_eq!(picked(&table(&[1.0])), [1.0]);
        assert_eq!(picked(&table(&[0.0, 1.0, 0.0])), [0.0, 1.0, 0.0]);
    }
}
