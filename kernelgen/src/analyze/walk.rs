//! Walks over a stage as it would run, along all ways at once and into the functions it calls.

use super::constant::{Scalar, Values};
use super::place::{Leaves, Place, Root, Step};
use super::place_of;
use super::state::{Pushes, State, join};
use super::uses::Uses;
use crate::link::Linked;
use crate::source::Span;
use naga::{Block, Expression, Function, Handle, LocalVariable, Module, Statement, SwitchCase, SwitchValue};
use std::collections::{BTreeMap, BTreeSet};

/// Rounds of a loop that are followed before what still changes is given up.
const LOOP_ROUNDS: usize = 3;

/// The prefix of functions that push to a stream.
const PUSH: &str = "push_";

/// What a function was called with.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Argument {
    Pointer(Place),
    Value(Values),
}

impl Argument {
    /// The record that a stage is given as its parameter of this index.
    pub(super) fn record(parameter: usize) -> Self {
        Argument::Pointer(Place::of(Root::Record(parameter)))
    }

    /// Whether the callee can reach the caller's state through it.
    fn reaches_state(&self) -> bool {
        matches!(self, Argument::Pointer(Place { root: Root::Record(_) | Root::Local(..), .. }))
    }
}

/// What holds when a stage has returned.
#[derive(Debug, Default)]
pub(super) struct End {
    /// Leaves written on every return.
    pub written: BTreeSet<usize>,
    /// Leaves that on every return hold what another one held on entry, and that one.
    pub copies: BTreeMap<usize, usize>,
    /// Most pushes to each stream.
    pub pushes: Pushes,
    /// Every return of a value.
    pub exits: Vec<Exit>,
}

/// A return.
#[derive(Debug)]
pub(super) struct Exit {
    /// Its place in the linked text.
    pub span: naga::Span,
    /// What it may return.
    pub values: Values,
    /// Leaves surely written there.
    pub written: BTreeSet<usize>,
}

/// What a call did that needed nothing of its caller's state.
#[derive(Clone)]
struct Summary {
    returns: bool,
    values: Values,
    pushes: Pushes,
}

/// A leaf that a load has read as a whole.
#[derive(Clone, Copy)]
struct LoadedLeaf {
    leaf: usize,
    /// The leaf whose value on entry it held then, if any.
    holds: Option<usize>,
}

/// A function that is being walked over.
struct Frame<'m> {
    handle: Handle<Function>,
    function: &'m Function,
    depth: usize,
    arguments: Vec<Argument>,
    /// Values of expressions that have been evaluated.
    values: BTreeMap<Handle<Expression>, Values>,
    /// What loads of whole leaves have read.
    loaded: BTreeMap<Handle<Expression>, Vec<LoadedLeaf>>,
    /// What holds at its returns so far.
    returned: Option<State>,
    result: Values,
    exits: Vec<Exit>,
}

/// Ways that left a loop or a switch, or went on to its next round.
#[derive(Default)]
struct Jumps {
    breaks: Option<State>,
    continues: Option<State>,
}

/// The walk, and what it has met.
pub(super) struct Walk<'m> {
    module: &'m Module,
    linked: &'m Linked,
    pub leaves: Leaves,
    /// Leaves read where they were not surely written, with the first place.
    pub read: BTreeMap<usize, Span>,
    /// Leaves read anywhere for something else than to be copied to a leaf.
    pub used: BTreeSet<usize>,
    /// Leaves read to be copied, and the leaves that they were copied to, wherever that was.
    pub copied: BTreeSet<(usize, usize)>,
    /// Leaves written anywhere, with the first place.
    pub stored: BTreeMap<usize, Span>,
    /// Names of the module's variables in use.
    pub globals: BTreeSet<String>,
    summaries: BTreeMap<(Handle<Function>, Vec<Argument>), Summary>,
    uses: Uses<'m>,
}

impl<'m> Walk<'m> {
    pub(super) fn new(module: &'m Module, linked: &'m Linked, leaves: Leaves) -> Self {
        Walk {
            module,
            linked,
            leaves,
            read: BTreeMap::new(),
            used: BTreeSet::new(),
            copied: BTreeSet::new(),
            stored: BTreeMap::new(),
            globals: BTreeSet::new(),
            summaries: BTreeMap::new(),
            uses: Uses::new(module),
        }
    }

    /// Walks over a stage function from its beginning, with nothing written.
    pub(super) fn stage(&mut self, function: Handle<Function>, arguments: Vec<Argument>) -> End {
        let frame = self.run(function, arguments, State::default(), 0);
        let end = frame.returned.unwrap_or_default();
        let copies = end.held.into_iter().filter_map(|(leaf, held)| Some((leaf, held?)));
        let copies = copies.filter(|(leaf, held)| leaf != held).collect();
        End { written: end.written, copies, pushes: end.pushes, exits: frame.exits }
    }

    fn run(&mut self, handle: Handle<Function>, arguments: Vec<Argument>, mut state: State, depth: usize) -> Frame<'m> {
        let function = &self.module.functions[handle];
        let mut frame = Frame {
            handle,
            function,
            depth,
            arguments,
            values: BTreeMap::new(),
            loaded: BTreeMap::new(),
            returned: None,
            result: Values::none(),
            exits: Vec::new(),
        };
        for (handle, local) in function.local_variables.iter() {
            let values = match local.init {
                Some(init) => self.evaluate(&frame, init),
                None => Values::zero(self.module, local.ty),
            };
            set_local(&mut state, (depth, handle), values);
        }
        let end = self.block(&mut frame, &mut Jumps::default(), &function.body, state);
        frame.returned = join(frame.returned, end);
        if let Some(state) = &mut frame.returned {
            state.locals.retain(|local, _| local.0 != depth);
        }
        frame
    }

    /// Walks over a block; nothing is returned if no way reaches its end.
    fn block(&mut self, frame: &mut Frame<'m>, jumps: &mut Jumps, block: &'m Block, state: State) -> Option<State> {
        let mut state = state;
        for (statement, span) in block.span_iter() {
            state = self.statement(frame, jumps, statement, *span, state)?;
        }
        Some(state)
    }

    fn statement(
        &mut self,
        frame: &mut Frame<'m>,
        jumps: &mut Jumps,
        statement: &'m Statement,
        span: naga::Span,
        mut state: State,
    ) -> Option<State> {
        match statement {
            Statement::Emit(range) => {
                for expression in range.clone() {
                    self.emit(frame, expression, &state);
                }
            }
            Statement::Block(block) => return self.block(frame, jumps, block, state),
            Statement::If { condition, accept, reject } => {
                return match self.evaluate(frame, *condition).truth() {
                    Some(true) => self.block(frame, jumps, accept, state),
                    Some(false) => self.block(frame, jumps, reject, state),
                    None => {
                        let accepted = self.block(frame, jumps, accept, state.clone());
                        join(accepted, self.block(frame, jumps, reject, state))
                    }
                };
            }
            Statement::Switch { selector, cases } => {
                let selector = self.evaluate(frame, *selector);
                return self.switch(frame, jumps, &selector, cases, state);
            }
            Statement::Loop { body, continuing, break_if } => {
                return self.cycle(frame, body, continuing, *break_if, state);
            }
            Statement::Break => {
                jumps.breaks = join(jumps.breaks.take(), Some(state));
                return None;
            }
            Statement::Continue => {
                jumps.continues = join(jumps.continues.take(), Some(state));
                return None;
            }
            Statement::Return { value } => {
                if let Some(value) = value {
                    self.exit(frame, *value, span, &state);
                }
                frame.returned = join(frame.returned.take(), Some(state));
                return None;
            }
            Statement::Kill => return None,
            Statement::Store { pointer, value } => {
                self.store(frame, self.place(frame, *pointer), *value, span, &mut state);
            }
            Statement::Call { function, arguments, result } => {
                let (values, state) = self.call(frame, *function, arguments, state)?;
                if let Some(result) = result {
                    frame.values.insert(*result, values);
                }
                return Some(state);
            }
            Statement::Atomic { pointer, .. } | Statement::WorkGroupUniformLoad { pointer, .. } => {
                self.touch(&self.place(frame, *pointer));
            }
            Statement::ImageStore { image, .. } | Statement::ImageAtomic { image, .. } => {
                self.touch(&self.place(frame, *image));
            }
            // Barriers, subgroup operations and ray queries touch no record; their results are unknown.
            _ => {}
        }
        Some(state)
    }

    fn exit(&mut self, frame: &mut Frame<'m>, value: Handle<Expression>, span: naga::Span, state: &State) {
        let values = self.evaluate(frame, value);
        let place = frame.function.expressions.get_span(value);
        let span = if place.is_defined() { place } else { span };
        frame.exits.push(Exit { span, values: values.clone(), written: state.written.clone() });
        frame.result = std::mem::replace(&mut frame.result, Values::none()).join(values);
    }

    fn switch(
        &mut self,
        frame: &mut Frame<'m>,
        jumps: &mut Jumps,
        selector: &Values,
        cases: &'m [SwitchCase],
        state: State,
    ) -> Option<State> {
        let mut inner = Jumps { breaks: None, continues: jumps.continues.take() };
        let mut fallen = None;
        let mut end = None;
        for case in cases {
            let entered = can_enter(selector, case, cases).then(|| state.clone());
            if let Some(state) = join(entered, fallen.take()) {
                let left = self.block(frame, &mut inner, &case.body, state);
                if case.fall_through { fallen = left } else { end = join(end, left) }
            }
        }
        jumps.continues = inner.continues;
        join(join(end, fallen), inner.breaks)
    }

    /// Follows a loop until nothing new holds at its head.
    fn cycle(
        &mut self,
        frame: &mut Frame<'m>,
        body: &'m Block,
        continuing: &'m Block,
        break_if: Option<Handle<Expression>>,
        state: State,
    ) -> Option<State> {
        let mut head = state;
        for round in 0.. {
            let mut jumps = Jumps::default();
            let end = self.block(frame, &mut jumps, body, head.clone());
            let end = join(end, jumps.continues.take());
            let mut back = end.and_then(|state| self.block(frame, &mut jumps, continuing, state));
            if let Some(condition) = break_if {
                let condition = self.evaluate(frame, condition).truth();
                if condition != Some(false) {
                    jumps.breaks = join(jumps.breaks, back.clone());
                }
                back = back.filter(|_| condition != Some(true));
            }
            let next = back.map_or(head.clone(), |back| head.clone().join(back));
            if next == head {
                return jumps.breaks;
            }
            head = if round < LOOP_ROUNDS { next } else { head.widen(&next) };
        }
        None
    }

    fn call(
        &mut self,
        frame: &Frame<'m>,
        function: Handle<Function>,
        arguments: &[Handle<Expression>],
        mut state: State,
    ) -> Option<(Values, State)> {
        let arguments: Vec<Argument> = arguments.iter().map(|argument| self.argument(frame, *argument)).collect();
        for argument in &arguments {
            if let Argument::Pointer(place) = argument {
                self.touch(place);
            }
        }
        let name = self.module.functions[function].name.as_deref().unwrap_or_default();
        if let Some(stream) = name.strip_prefix(PUSH) {
            state.push(&Pushes::from([(stream.to_string(), Some(1))]));
        }
        if arguments.iter().any(Argument::reaches_state) {
            let callee = self.run(function, arguments, state, frame.depth + 1);
            return callee.returned.map(|state| (callee.result, state));
        }
        let summary = self.summary(function, arguments);
        state.push(&summary.pushes);
        summary.returns.then_some((summary.values, state))
    }

    fn summary(&mut self, function: Handle<Function>, arguments: Vec<Argument>) -> Summary {
        let key = (function, arguments);
        if let Some(known) = self.summaries.get(&key) {
            return known.clone();
        }
        let frame = self.run(function, key.1.clone(), State::default(), 0);
        let summary = Summary {
            returns: frame.returned.is_some(),
            values: frame.result,
            pushes: frame.returned.map(|state| state.pushes).unwrap_or_default(),
        };
        self.summaries.insert(key, summary.clone());
        summary
    }

    fn argument(&self, frame: &Frame<'m>, expression: Handle<Expression>) -> Argument {
        match self.place(frame, expression) {
            Place { root: Root::Other, .. } => Argument::Value(self.evaluate(frame, expression)),
            place => Argument::Pointer(place),
        }
    }

    /// What a pointer expression points to.
    fn place(&self, frame: &Frame<'m>, pointer: Handle<Expression>) -> Place {
        match frame.function.expressions[pointer] {
            Expression::FunctionArgument(index) => match frame.arguments.get(index as usize) {
                Some(Argument::Pointer(place)) => place.clone(),
                _ => Place::of(Root::Other),
            },
            Expression::LocalVariable(local) => Place::of(Root::Local(frame.depth, local)),
            Expression::GlobalVariable(global) => Place::of(Root::Global(global)),
            Expression::AccessIndex { base, index } => self.place(frame, base).step(Some(index)),
            Expression::Access { base, .. } => self.place(frame, base).step(None),
            _ => Place::of(Root::Other),
        }
    }

    fn emit(&mut self, frame: &mut Frame<'m>, expression: Handle<Expression>, state: &State) {
        let values = match frame.function.expressions[expression] {
            Expression::Load { pointer } => {
                let place = self.place(frame, pointer);
                self.load(frame, expression, &place, state)
            }
            Expression::ImageSample { image, sampler, .. } => {
                self.touch(&self.place(frame, image));
                self.touch(&self.place(frame, sampler));
                Values::Unknown
            }
            Expression::ImageLoad { image, .. } | Expression::ImageQuery { image, .. } => {
                self.touch(&self.place(frame, image));
                Values::Unknown
            }
            Expression::ArrayLength(array) => {
                self.touch(&self.place(frame, array));
                Values::Unknown
            }
            _ => self.compute(frame, expression),
        };
        frame.values.insert(expression, values);
    }

    fn load(&mut self, frame: &mut Frame<'m>, expression: Handle<Expression>, place: &Place, state: &State) -> Values {
        match place.root {
            Root::Record(record) => {
                let span = place_of(frame.function.expressions.get_span(expression), self.linked);
                let covered = self.leaves.covered(record, &place.path);
                let is_copied = covered.whole && self.uses.is_only_stored(frame.handle, expression);
                for members in self.uses.paths(frame.handle, expression) {
                    let path: Vec<Step> = place.path.iter().copied().chain(members.into_iter().map(Some)).collect();
                    self.read(record, &path, span, state);
                    if !is_copied {
                        self.used.extend(self.leaves.covered(record, &path).leaves);
                    }
                }
                if covered.whole {
                    let loaded = covered.leaves.map(|leaf| LoadedLeaf { leaf, holds: state.holds(leaf) });
                    frame.loaded.insert(expression, loaded.collect());
                }
                Values::Unknown
            }
            Root::Local(depth, local) if place.path.is_empty() => {
                state.locals.get(&(depth, local)).cloned().unwrap_or(Values::Unknown)
            }
            _ => {
                self.touch(place);
                Values::Unknown
            }
        }
    }

    fn read(&mut self, record: usize, path: &[Step], span: Span, state: &State) {
        for leaf in self.leaves.covered(record, path).leaves {
            if !state.written.contains(&leaf) {
                self.read.entry(leaf).or_insert(span);
            }
        }
    }

    fn store(
        &mut self,
        frame: &Frame<'m>,
        place: Place,
        value: Handle<Expression>,
        span: naga::Span,
        state: &mut State,
    ) {
        let loaded = frame.loaded.get(&value).map_or(&[][..], Vec::as_slice);
        match place.root {
            Root::Record(record) => self.store_leaves(record, &place.path, loaded, span, state),
            Root::Local(depth, local) => {
                let values = if place.path.is_empty() { self.evaluate(frame, value) } else { Values::Unknown };
                set_local(state, (depth, local), values);
                self.use_loaded(loaded);
            }
            Root::Global(_) | Root::Other => {
                self.touch(&place);
                self.use_loaded(loaded);
            }
        }
    }

    /// Stores to a part of a record a value that was loaded from these leaves, or from none.
    fn store_leaves(
        &mut self,
        record: usize,
        path: &[Step],
        loaded: &[LoadedLeaf],
        span: naga::Span,
        state: &mut State,
    ) {
        let span = place_of(span, self.linked);
        let covered = self.leaves.covered(record, path);
        let copies = covered.whole && loaded.len() == covered.leaves.len();
        if !covered.whole {
            self.read(record, path, span, state);
            self.used.extend(covered.leaves.clone());
        }
        if !copies {
            self.use_loaded(loaded);
        }
        for (position, leaf) in covered.leaves.enumerate() {
            let source = loaded.get(position).filter(|_| copies);
            self.copied.extend(source.map(|source| (source.leaf, leaf)));
            state.held.insert(leaf, source.and_then(|source| source.holds));
            state.written.insert(leaf);
            self.stored.entry(leaf).or_insert(span);
        }
    }

    /// What is done with a loaded value is no copy to a leaf.
    fn use_loaded(&mut self, loaded: &[LoadedLeaf]) {
        self.used.extend(loaded.iter().map(|loaded| loaded.leaf));
    }

    fn touch(&mut self, place: &Place) {
        if let Root::Global(global) = place.root {
            let name = self.module.global_variables[global].name.clone();
            self.globals.insert(name.unwrap_or_default());
        }
    }

    /// The values of an expression that has been evaluated, or that needs no evaluation.
    fn evaluate(&self, frame: &Frame<'m>, expression: Handle<Expression>) -> Values {
        match frame.values.get(&expression) {
            Some(values) => values.clone(),
            None => self.compute(frame, expression),
        }
    }

    fn compute(&self, frame: &Frame<'m>, expression: Handle<Expression>) -> Values {
        match frame.function.expressions[expression] {
            Expression::Literal(literal) => Values::literal(literal),
            Expression::Constant(constant) => Values::global(self.module, self.module.constants[constant].init),
            Expression::ZeroValue(ty) => Values::zero(self.module, ty),
            Expression::FunctionArgument(index) => match frame.arguments.get(index as usize) {
                Some(Argument::Value(values)) => values.clone(),
                _ => Values::Unknown,
            },
            Expression::Unary { op, expr } => self.evaluate(frame, expr).unary(op),
            Expression::Binary { op, left, right } => {
                self.evaluate(frame, left).binary(op, self.evaluate(frame, right))
            }
            Expression::Select { condition, accept, reject } => match self.evaluate(frame, condition).truth() {
                Some(true) => self.evaluate(frame, accept),
                Some(false) => self.evaluate(frame, reject),
                None => self.evaluate(frame, accept).join(self.evaluate(frame, reject)),
            },
            _ => Values::Unknown,
        }
    }
}

/// Whether a switch can start at this case.
fn can_enter(selector: &Values, case: &SwitchCase, cases: &[SwitchCase]) -> bool {
    let Values::Known(selectors) = selector else {
        return true;
    };
    let matches = |case: &SwitchCase, scalar| scalar_of(case.value) == Some(scalar);
    selectors.iter().any(|scalar| match case.value {
        SwitchValue::Default => !cases.iter().any(|other| matches(other, *scalar)),
        _ => matches(case, *scalar),
    })
}

fn scalar_of(value: SwitchValue) -> Option<Scalar> {
    match value {
        SwitchValue::U32(value) => Some(Scalar::U32(value)),
        SwitchValue::I32(value) => Some(Scalar::I32(value)),
        SwitchValue::Default => None,
    }
}

fn set_local(state: &mut State, local: (usize, Handle<LocalVariable>), values: Values) {
    match values {
        Values::Known(_) => state.locals.insert(local, values),
        Values::Unknown => state.locals.remove(&local),
    };
}
