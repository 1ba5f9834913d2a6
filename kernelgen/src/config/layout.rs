//! The layout axis: interleaving, tables, explicit placement.

use super::merge::AxisFile;
use super::model::{Encode, Layout, Order, Placed, PlacedField, PlacedRow};
use super::section::{Findings, Item, Section};
use super::tree::Data;
use crate::diagnostic::Diagnostic;
use crate::source::Spanned;
use indexmap::IndexMap;

/// Keys of `[layout]`.
pub const KEYS: [&str; 9] = ["order", "lane", "dead", "share", "rays", "ray_lane", "encode", "tables", "place"];

/// The layout; `None` when a required key is missing or refused.
pub fn read(file: &AxisFile, top: &Section<'_>, findings: &mut Findings) -> Option<Layout> {
    let section = top.require("layout", "write `[layout]`", findings)?.section(findings)?;
    section.allow(&KEYS, findings);
    let order = section.require("order", "write `order = \"aos\"`, `\"soa\"` or `\"aosoa32\"`", findings);
    let order = order.and_then(|item| self::order(&item, findings));
    let lane = section.require("lane", "32-bit words an access: `lane = 1`, `2` or `4`", findings);
    let lane = lane.and_then(|item| self::lane(&item, findings));
    let dead = section.get("dead").and_then(|item| item.word(&["drop", "keep"], findings));
    let share = section.get("share").and_then(|item| item.boolean(findings));
    let rays = section.get("rays").and_then(|item| item.word(&["beside", "apart"], findings));
    let ray_lane = section.get("ray_lane").and_then(|item| self::lane(&item, findings));
    let encode = encode(&section, findings);
    let tables = tables(&section, findings);
    let place = section.get("place").map(|item| rows(&item, findings)).unwrap_or_default();
    Some(Layout {
        name: file.name.clone(),
        doc: file.doc.clone(),
        order: order?,
        lane: lane?,
        drop_dead: dead != Some(1),
        share: share.unwrap_or_default(),
        rays_apart: rays == Some(1),
        ray_lane: ray_lane.or(lane)?,
        encode,
        tables,
        place,
        span: section.span,
    })
}

fn order(item: &Item<'_>, findings: &mut Findings) -> Option<Order> {
    let text = item.text(findings)?;
    match text.value.as_str() {
        "aos" => return Some(Order::Aos),
        "soa" => return Some(Order::Soa),
        _ => {}
    }
    let Some(block) = text.value.strip_prefix("aosoa") else {
        findings.push(
            item.unknown_word(&text, ["aos", "soa", "aosoa32"])
                .help("the number after `aosoa` is the paths of a block: a power of two from 2 to 1024"),
        );
        return None;
    };
    let size = block.parse().ok().filter(|size: &u32| size.is_power_of_two() && (2..=1024).contains(size));
    if size.is_none() {
        let refused = Diagnostic::error("K0107", format!("`{}` cannot be `{}`", item.path, text.value))
            .at(text.span, "the paths of a block are not a power of two from 2 to 1024")
            .help("write, for example, `order = \"aosoa32\"`");
        findings.push(refused);
    }
    size.map(Order::Aosoa)
}

fn lane(item: &Item<'_>, findings: &mut Findings) -> Option<u32> {
    let Data::Integer(number) = item.node.data else {
        return item.integer(1..=4, findings);
    };
    let lane = [1, 2, 4].into_iter().find(|lane| i128::from(*lane) == number);
    if lane.is_none() {
        let refused = Diagnostic::error("K0107", format!("`{}` cannot be {number}", item.path))
            .at(item.span(), "a lane is loaded as u32, vec2u or vec4u")
            .help(format!("`{}` is one of 1, 2, 4", item.name));
        findings.push(refused);
    }
    lane
}

fn encode(section: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Encode> {
    let mut encode = IndexMap::new();
    for item in section.entries("encode", findings) {
        if let Some(codec) = item.text(findings) {
            encode.insert(item.name.to_owned(), Encode { key: item.key, codec });
        }
    }
    encode
}

fn tables(section: &Section<'_>, findings: &mut Findings) -> IndexMap<String, Vec<Spanned<String>>> {
    let mut tables = IndexMap::new();
    for item in section.entries("tables", findings) {
        super::name::check("table", &item, findings);
        tables.insert(item.name.to_owned(), item.texts(findings).unwrap_or_default());
    }
    tables
}

fn rows(item: &Item<'_>, findings: &mut Findings) -> Vec<PlacedRow> {
    let rows = item.list(findings).unwrap_or_default();
    rows.iter().filter_map(|row| self::row(row, findings)).collect()
}

fn row(item: &Item<'_>, findings: &mut Findings) -> Option<PlacedRow> {
    let parts = item.list(findings)?;
    let parts = parts.iter().filter_map(|part| self::part(part, findings)).collect();
    Some(PlacedRow { span: item.span(), parts })
}

fn part(item: &Item<'_>, findings: &mut Findings) -> Option<Placed> {
    if matches!(item.node.data, Data::List(_)) {
        let fields = item.list(findings)?;
        return Some(Placed::Bits(fields.iter().filter_map(|field| placed(field, findings)).collect()));
    }
    placed(item, findings).map(Placed::Words)
}

/// `"eye.position"`, `"eye.hit.uv"`, `"eye.flags:8"`, `"_"`, `"_:24"`.
fn placed(item: &Item<'_>, findings: &mut Findings) -> Option<PlacedField> {
    let text = item.text(findings)?;
    let (field, bits) = match text.value.split_once(':') {
        Some((field, bits)) => (field, Some(width(field, bits, &text, findings)?)),
        None => (text.value.as_str(), None),
    };
    let field = (field != "_").then(|| field.to_owned());
    Some(PlacedField { span: text.span, field, bits })
}

fn width(field: &str, bits: &str, text: &Spanned<String>, findings: &mut Findings) -> Option<u32> {
    let width = bits.parse().ok().filter(|width| (1..=32).contains(width));
    if width.is_none() {
        let refused = Diagnostic::error("K0410", format!("`{bits}` is no number of bits"))
            .at(text.span, "the part after the colon is a width")
            .help(format!("write a width from 1 to 32: `{field}:8`"));
        findings.push(refused);
    }
    width
}
