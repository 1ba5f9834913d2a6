//! What a pointer of a stage points to, and which leaves that covers.

use super::Leaf;
use naga::{GlobalVariable, Handle, LocalVariable, Module, Type, TypeInner};
use std::ops::Range;

/// The struct whose members are leaves of their own.
const HIT: &str = "Hit";

/// Where an access chain starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Root {
    /// A record that the stage was given: its parameter's index.
    Record(usize),
    /// A local variable of the function at this depth of calls.
    Local(usize, Handle<LocalVariable>),
    /// A variable of the module.
    Global(Handle<GlobalVariable>),
    /// Not followed.
    Other,
}

/// A step of an access chain: a constant index, or one that is computed.
pub(super) type Step = Option<u32>;

/// What a pointer points to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub root: Root,
    pub path: Vec<Step>,
}

impl Place {
    pub(super) fn of(root: Root) -> Self {
        Place { root, path: Vec::new() }
    }

    pub(super) fn step(mut self, step: Step) -> Self {
        self.path.push(step);
        self
    }
}

/// The leaves of the records that a stage was given.
#[derive(Debug, Default)]
pub(super) struct Leaves {
    all: Vec<Leaf>,
    /// For each parameter, for each field: its leaves.
    records: Vec<Vec<Range<usize>>>,
}

/// The leaves that an access covers.
pub(super) struct Covered {
    pub leaves: Range<usize>,
    /// Whether all of every leaf.
    pub whole: bool,
}

impl Leaves {
    /// Adds the record that the next parameter points to.
    pub(super) fn add_record(&mut self, module: &Module, record: Handle<Type>, instance: &str) {
        let mut fields = Vec::new();
        for (name, ty) in struct_members(module, record) {
            let start = self.all.len();
            let leaf = |member| Leaf { instance: instance.to_string(), field: name.clone(), member };
            if module.types[ty].name.as_deref() == Some(HIT) {
                let members = struct_members(module, ty);
                self.all.extend(members.into_iter().map(|(member, _)| leaf(Some(member))));
            } else {
                self.all.push(leaf(None));
            }
            fields.push(start..self.all.len());
        }
        self.records.push(fields);
    }

    pub(super) fn get(&self, index: usize) -> &Leaf {
        &self.all[index]
    }

    /// What an access to this part of a record covers.
    pub(super) fn covered(&self, record: usize, path: &[Step]) -> Covered {
        let fields = &self.records[record];
        let everything = fields.first().map_or(0, |field| field.start)..fields.last().map_or(0, |field| field.end);
        let Some(field) = path.first().and_then(|step| fields.get((*step)? as usize)) else {
            return Covered { leaves: everything, whole: path.is_empty() };
        };
        match path[1..] {
            [] => Covered { leaves: field.clone(), whole: true },
            [Some(member), ref rest @ ..] if field.len() > 1 => {
                let leaf = field.start + member as usize;
                Covered { leaves: leaf..leaf + 1, whole: rest.is_empty() }
            }
            _ => Covered { leaves: field.clone(), whole: false },
        }
    }
}

fn struct_members(module: &Module, ty: Handle<Type>) -> Vec<(String, Handle<Type>)> {
    match &module.types[ty].inner {
        TypeInner::Struct { members, .. } => {
            members.iter().map(|member| (member.name.clone().unwrap_or_default(), member.ty)).collect()
        }
        _ => Vec::new(),
    }
}
