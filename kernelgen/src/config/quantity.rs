//! What a field is: its WGSL type, its leaves, its width.

/// What a field is. It fixes the WGSL type and the number of 32-bit words or bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A point, m.
    Position,
    /// A direction of length 1.
    UnitVector,
    /// Radiance, importance or throughput, linear sRGB, >= 0.
    Spectrum,
    /// A density, 1/sr or 1/m^2.
    Pdf,
    /// A partial sum of MIS ratios.
    MisPartial,
    /// A distance, m.
    Length,
    /// A weight without unit.
    Weight,
    /// Surface coordinates.
    Uv,
    /// A ray hit: primitive, distance, barycentric coordinates.
    Hit,
    /// A whole 32-bit number.
    Index,
    /// A number below 2^bits.
    Counter {
        /// Width, 1 to 32.
        bits: u32,
    },
    /// One bit a name.
    Flags {
        /// Names, lowest bit first.
        names: Vec<String>,
    },
}

/// The WGSL type of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeafType {
    /// `u32`.
    U32,
    /// `real`.
    Real,
    /// `vec2r`.
    Vec2,
    /// `vec3r`.
    Vec3,
}

impl LeafType {
    /// 32-bit words of the uncoded value.
    pub fn words(self) -> u32 {
        match self {
            LeafType::U32 | LeafType::Real => 1,
            LeafType::Vec2 => 2,
            LeafType::Vec3 => 3,
        }
    }
}

/// A part of a field that is read and written as one: all of it, or a member of a hit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeafShape {
    /// Member path below the field: empty, or `["prim"]`.
    pub member: Option<&'static str>,
    /// Its type.
    pub ty: LeafType,
    /// Its width in bits: 32 a word, or fewer for counters and flags.
    pub bits: u32,
    /// The word for what it is: the field's quantity, or of a hit's member its own.
    pub quantity: &'static str,
}

impl Quantity {
    /// The words accepted for `quantity`.
    pub const NAMES: [&'static str; 12] = [
        "position",
        "unit_vector",
        "spectrum",
        "pdf",
        "mis_partial",
        "length",
        "weight",
        "uv",
        "hit",
        "index",
        "counter",
        "flags",
    ];

    /// The words that a codec may name: what can be kept in fewer bits.
    pub const CODED: [&str; 6] = ["unit_vector", "spectrum", "pdf", "mis_partial", "weight", "uv"];

    /// The word that names the quantity in a config.
    pub fn name(&self) -> &'static str {
        match self {
            Quantity::Position => "position",
            Quantity::UnitVector => "unit_vector",
            Quantity::Spectrum => "spectrum",
            Quantity::Pdf => "pdf",
            Quantity::MisPartial => "mis_partial",
            Quantity::Length => "length",
            Quantity::Weight => "weight",
            Quantity::Uv => "uv",
            Quantity::Hit => "hit",
            Quantity::Index => "index",
            Quantity::Counter { .. } => "counter",
            Quantity::Flags { .. } => "flags",
        }
    }

    /// The WGSL type in a record's struct.
    pub fn wgsl(&self) -> &'static str {
        match self {
            Quantity::Position | Quantity::UnitVector | Quantity::Spectrum => "vec3r",
            Quantity::Pdf | Quantity::MisPartial | Quantity::Length | Quantity::Weight => "real",
            Quantity::Uv => "vec2r",
            Quantity::Hit => "Hit",
            Quantity::Index | Quantity::Counter { .. } | Quantity::Flags { .. } => "u32",
        }
    }

    /// The parts that are stored separately.
    pub fn leaves(&self) -> Vec<LeafShape> {
        let quantity = self.name();
        let whole = |ty: LeafType| vec![LeafShape { member: None, ty, bits: 32 * ty.words(), quantity }];
        let member =
            |name, ty: LeafType, quantity| LeafShape { member: Some(name), ty, bits: 32 * ty.words(), quantity };
        let packed = |bits| vec![LeafShape { member: None, ty: LeafType::U32, bits, quantity }];
        match self {
            Quantity::Position | Quantity::UnitVector | Quantity::Spectrum => whole(LeafType::Vec3),
            Quantity::Pdf | Quantity::MisPartial | Quantity::Length | Quantity::Weight => whole(LeafType::Real),
            Quantity::Uv => whole(LeafType::Vec2),
            Quantity::Hit => {
                vec![
                    member("prim", LeafType::U32, "index"),
                    member("t", LeafType::Real, "length"),
                    member("uv", LeafType::Vec2, "uv"),
                ]
            }
            Quantity::Index => whole(LeafType::U32),
            Quantity::Counter { bits } => packed(*bits),
            Quantity::Flags { names } => packed(names.len().max(1) as u32),
        }
    }
}
