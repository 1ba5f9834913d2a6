//! The binary form of glTF: a JSON chunk and one buffer of tightly packed accessors.

use serde_json::{Value, json};

/// The buffer of a file under construction, with the views and accessors into it.
#[derive(Default)]
pub struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

impl Buffer {
    /// Adds three floats an element, rounded from f64; `bounded` writes the minimum and maximum that glTF wants of positions.
    pub fn vec3(&mut self, values: impl Iterator<Item = [f64; 3]>, bounded: bool) -> usize {
        let values: Vec<[f32; 3]> = values.map(|value| value.map(|x| x as f32)).collect();
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let mut accessor = json!({ "componentType": FLOAT, "count": values.len(), "type": "VEC3" });
        if bounded {
            let extreme = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..3).map(|i| values.iter().map(|value| value[i]).reduce(pick).unwrap_or(0.0)).collect()
            };
            accessor["min"] = json!(extreme(f32::min));
            accessor["max"] = json!(extreme(f32::max));
        }
        self.push(bytes, accessor)
    }

    /// Adds indices, in two bytes each where they fit.
    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let short = indices.iter().all(|&index| index < 65_535);
        let (component, bytes) = if short {
            (UNSIGNED_SHORT, indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect())
        } else {
            (UNSIGNED_INT, indices.iter().flat_map(|index| index.to_le_bytes()).collect())
        };
        self.push(bytes, json!({ "componentType": component, "count": indices.len(), "type": "SCALAR" }))
    }

    fn push(&mut self, bytes: Vec<u8>, mut accessor: Value) -> usize {
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.accessors.push(accessor);
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.accessors.len() - 1
    }

    /// The whole file: the document with this buffer, its views and accessors put in.
    pub fn finish(self, mut document: Value) -> Vec<u8> {
        if !self.bytes.is_empty() {
            document["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
            document["bufferViews"] = json!(self.views);
            document["accessors"] = json!(self.accessors);
        }
        file(&document, &self.bytes)
    }
}

/// A whole file of a document and its binary chunk, whose length is a multiple of four.
pub fn file(document: &Value, bytes: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    container(&[(*b"JSON", &text), (*b"BIN\0", bytes)])
}

/// The document and the binary chunk of a whole file.
///
/// # Panics
/// When it is none.
pub fn parts(file: &[u8]) -> (Value, Vec<u8>) {
    let length = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes")) as usize;
    let text = length(12);
    let document = serde_json::from_slice(&file[20..20 + text]).expect("the first chunk is JSON");
    let binary = 20 + text;
    let bytes = if binary < file.len() { file[binary + 8..][..length(binary)].to_vec() } else { Vec::new() };
    (document, bytes)
}

fn container(chunks: &[([u8; 4], &[u8])]) -> Vec<u8> {
    let chunks: Vec<_> = chunks.iter().filter(|(_, bytes)| !bytes.is_empty()).collect();
    let total = 12 + chunks.iter().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
    let mut file = b"glTF".to_vec();
    file.extend(2u32.to_le_bytes());
    file.extend((total as u32).to_le_bytes());
    for (kind, bytes) in chunks {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(*bytes);
    }
    file
}
