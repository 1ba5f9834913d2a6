//! Where every byte of a linked text comes from.

use crate::source::{FileId, Span};

/// A stretch of output that was copied from one place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Segment {
    start: usize,
    end: usize,
    file: FileId,
    origin: usize,
}

/// The copied stretches of a linked text, in order; what lies between them was made by the linker.
#[derive(Clone, Debug, Default)]
pub struct SourceMap {
    segments: Vec<Segment>,
}

impl SourceMap {
    /// Notes that the `length` bytes at `start` of the output are those at `origin` of a file.
    pub(super) fn push(&mut self, start: usize, length: usize, file: FileId, origin: usize) {
        if length > 0 {
            self.segments.push(Segment { start, end: start + length, file, origin });
        }
    }

    /// The origin of one byte of the output; `None` where the linker made it.
    pub fn locate(&self, offset: usize) -> Option<Span> {
        let index = self.segments.partition_point(|segment| segment.end <= offset);
        let segment = self.segments.get(index).filter(|segment| segment.start <= offset)?;
        let start = (segment.origin + offset - segment.start) as u32;
        Some(Span { file: segment.file, start, end: start + 1 })
    }

    /// The origin of a byte range of the output. Where the range spans several places, it is clipped to what follows its first copied byte
    /// in the same file; where it was made by the linker altogether, the nearest copied byte stands for it.
    pub fn span(&self, start: usize, end: usize) -> Span {
        let index = self.segments.partition_point(|segment| segment.end <= start);
        let Some(segment) = self.segments.get(index).or(self.segments.last()) else {
            return Span { file: FileId(0), start: 0, end: 0 };
        };
        let inside = start.clamp(segment.start, segment.end - 1);
        let origin = segment.origin + inside - segment.start;
        let clipped = segment.origin + end.clamp(inside, segment.end) - segment.start;
        let last =
            self.locate(end.saturating_sub(1)).filter(|last| last.file == segment.file && last.end as usize >= origin);
        let origin_end = last.map_or(clipped, |last| last.end as usize);
        Span { file: segment.file, start: origin as u32, end: origin_end.max(origin) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> SourceMap {
        let mut map = SourceMap::default();
        map.push(10, 5, FileId(0), 100);
        map.push(15, 5, FileId(0), 200);
        map.push(30, 5, FileId(1), 0);
        map
    }

    fn place(file: u32, start: u32, end: u32) -> Span {
        Span { file: FileId(file), start, end }
    }

    #[test]
    fn bytes_are_located_exactly() {
        assert_eq!(map().locate(9), None);
        assert_eq!(map().locate(10), Some(place(0, 100, 101)));
        assert_eq!(map().locate(14), Some(place(0, 104, 105)));
        assert_eq!(map().locate(15), Some(place(0, 200, 201)));
        assert_eq!(map().locate(20), None);
        assert_eq!(map().locate(34), Some(place(1, 4, 5)));
        assert_eq!(map().locate(35), None);
    }

    #[test]
    fn ranges_stay_in_one_file() {
        assert_eq!(map().span(11, 13), place(0, 101, 103));
        assert_eq!(map().span(13, 17), place(0, 103, 202));
        assert_eq!(map().span(17, 33), place(0, 202, 205));
        assert_eq!(map().span(2, 4), place(0, 100, 100));
        assert_eq!(map().span(50, 60), place(1, 4, 5));
    }
}
