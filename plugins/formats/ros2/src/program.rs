//! The numbers of a message: a definition and the wanted fields compiled to a list of steps, which
//! reads a message from front to back and ends after the last wanted field.

use crate::cdr::{Body, Cursor, body};
use crate::definition::{Definitions, Field, Kind, Shape};
use crate::error::{DefinitionError, MessageError};
use navfuse_frames::Number;

/// Largest number of steps; a type that contains many others many times would have any number.
const MOST_STEPS: usize = 1 << 14;
/// Largest depth of types within types.
const DEEPEST: usize = 32;
/// Largest number of fields that are wanted of one message.
pub const SLOTS: usize = 40;

/// The wanted numbers of a message; NaN where the message has none.
pub type Slots = [f64; SLOTS];

/// A step in reading a message.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// Skips numbers of a size.
    Skip {
        size: usize,
        count: usize,
    },
    /// Skips a list of numbers of a size.
    SkipList {
        size: usize,
    },
    SkipText,
    Take {
        number: Number,
        slot: usize,
    },
    /// Takes elements of a list of numbers, given as index and slot.
    Pick {
        number: Number,
        length: Option<u32>,
        wanted: Vec<(u32, usize)>,
    },
    /// Repeats steps for each element of a list; some elements have steps of their own.
    Each {
        length: Option<u32>,
        wanted: Vec<(u32, Vec<Step>)>,
        others: Vec<Step>,
    },
}

/// One part of a path: a field, and the index of its element.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Part {
    name: String,
    index: Option<u32>,
}

/// The path of a field: `twist.twist.linear.x`, `ranges[2]`.
fn parts(path: &str) -> Result<Vec<Part>, DefinitionError> {
    let part = |text: &str| match text.split_once('[') {
        None => Some(Part { name: text.to_owned(), index: None }),
        Some((name, index)) => {
            let index = index.strip_suffix(']')?.parse().ok()?;
            Some(Part { name: name.to_owned(), index: Some(index) })
        }
    };
    let found: Option<Vec<Part>> = path.split('.').map(|text| part(text.trim())).collect();
    found.ok_or_else(|| DefinitionError::Index(path.to_owned()))
}

/// A wanted field: the rest of its path, its slot, and the whole path for messages.
#[derive(Clone, Copy, Debug)]
struct Wanted<'a> {
    rest: &'a [Part],
    slot: usize,
    path: &'a str,
}

impl Wanted<'_> {
    fn tail(&self) -> Self {
        Self { rest: self.rest.get(1..).unwrap_or_default(), ..*self }
    }
}

/// The steps that read the wanted fields of a message type.
#[derive(Clone, Debug, PartialEq)]
pub struct Program(Vec<Step>);

/// The compiler, with the number of its steps so far.
struct Compiler<'a> {
    definitions: &'a Definitions,
    steps: usize,
}

impl Program {
    /// Compiles the reading of fields, the `k`-th into slot `k`; an empty path leaves its slot
    /// empty.
    ///
    /// # Errors
    /// When a path names no number of the type, or a definition is missing.
    pub fn new(
        definitions: &Definitions,
        of: &str,
        paths: &[&str],
    ) -> Result<Self, DefinitionError> {
        let split: Vec<Vec<Part>> = paths.iter().map(|p| parts(p)).collect::<Result<_, _>>()?;
        let all = split.iter().zip(paths).enumerate();
        let wanted: Vec<Wanted<'_>> = all
            .filter(|(_, (_, path))| !path.is_empty())
            .map(|(slot, (rest, path))| Wanted { rest, slot, path })
            .collect();
        let mut steps = Vec::new();
        Compiler { definitions, steps: 0 }.message(of, &wanted, true, 0, &mut steps)?;
        Ok(Self(steps))
    }

    /// Reads the fields of a message.
    ///
    /// # Errors
    /// When the message is too short, or not in plain CDR.
    pub fn read(&self, message: &[u8], slots: &mut Slots) -> Result<(), MessageError> {
        slots.fill(f64::NAN);
        match body(message)? {
            Body::Little(body) => run(&self.0, &mut Cursor::<true>::new(body), slots),
            Body::Big(body) => run(&self.0, &mut Cursor::<false>::new(body), slots),
            Body::Packed(body) => run(&self.0, &mut Cursor::<true>::packed(body), slots),
        }?;
        if slots.iter().any(|value| value.is_infinite()) {
            return Err(MessageError::Infinite);
        }
        Ok(())
    }
}

/// Tests whether a type has a field.
pub fn has_field(definitions: &Definitions, of: &str, path: &str) -> bool {
    Program::new(definitions, of, &[path]).is_ok()
}

impl Compiler<'_> {
    fn count(&mut self, of: &str) -> Result<(), DefinitionError> {
        self.steps += 1;
        match self.steps {
            n if n <= MOST_STEPS => Ok(()),
            _ => Err(DefinitionError::TooLarge(of.to_owned())),
        }
    }

    /// Adds the steps of a message; `last` if nothing is wanted after it.
    fn message(
        &mut self,
        of: &str,
        wanted: &[Wanted<'_>],
        last: bool,
        depth: usize,
        out: &mut Vec<Step>,
    ) -> Result<(), DefinitionError> {
        if depth > DEEPEST {
            return Err(DefinitionError::TooLarge(of.to_owned()));
        }
        let fields = self.definitions.fields(of)?.to_vec();
        if let Some(w) = wanted.iter().find(|w| w.rest.is_empty()) {
            return Err(DefinitionError::NoNumber(w.path.to_owned()));
        }
        let named = |w: &Wanted<'_>, field: &Field| w.rest[0].name == field.name;
        if let Some(w) = wanted.iter().find(|w| !fields.iter().any(|f| named(w, f))) {
            let names: Vec<&str> = fields.iter().map(|f| f.name.as_str()).collect();
            return Err(DefinitionError::Field {
                of: of.to_owned(),
                name: w.rest[0].name.clone(),
                fields: names.join(", "),
            });
        }
        if fields.is_empty() {
            // an empty message has one byte in CDR
            push(out, Step::Skip { size: 1, count: 1 });
        }
        let end = fields.iter().rposition(|f| wanted.iter().any(|w| named(w, f)));
        for (k, field) in fields.iter().enumerate() {
            if last && end.is_none_or(|end| k > end) {
                break;
            }
            let within: Vec<Wanted<'_>> =
                wanted.iter().filter(|w| named(w, field)).copied().collect();
            let last = last && end == Some(k);
            self.field(of, field, &within, last, depth, out)?;
        }
        Ok(())
    }

    fn field(
        &mut self,
        of: &str,
        field: &Field,
        wanted: &[Wanted<'_>],
        last: bool,
        depth: usize,
        out: &mut Vec<Step>,
    ) -> Result<(), DefinitionError> {
        self.count(of)?;
        let one = field.shape == Shape::One;
        if let Some(w) = wanted.iter().find(|w| w.rest[0].index.is_none() != one) {
            return Err(DefinitionError::Index(w.path.to_owned()));
        }
        let length = match field.shape {
            Shape::Array(length) => Some(length),
            Shape::One | Shape::Sequence => None,
        };
        match (&field.kind, one) {
            (Kind::Number(number), _) => self.number(*number, field.shape, wanted, out),
            (Kind::Text, _) if !wanted.is_empty() => {
                Err(DefinitionError::NoNumber(wanted[0].path.to_owned()))
            }
            (Kind::WideText, _) => Err(DefinitionError::Wide(format!("{of}.{}", field.name))),
            (Kind::Text, true) => {
                out.push(Step::SkipText);
                Ok(())
            }
            (Kind::Text, false) => {
                let others = vec![Step::SkipText];
                out.push(Step::Each { length, wanted: Vec::new(), others });
                Ok(())
            }
            (Kind::Message(name), true) => {
                let within: Vec<Wanted<'_>> = wanted.iter().map(Wanted::tail).collect();
                self.message(name, &within, last, depth + 1, out)
            }
            (Kind::Message(name), false) => {
                let mut others = Vec::new();
                self.message(name, &[], false, depth + 1, &mut others)?;
                let mut indices: Vec<u32> = wanted.iter().filter_map(|w| w.rest[0].index).collect();
                indices.sort_unstable();
                indices.dedup();
                let mut own = Vec::new();
                for index in indices {
                    let of_this = |w: &&Wanted<'_>| w.rest[0].index == Some(index);
                    let within: Vec<Wanted<'_>> =
                        wanted.iter().filter(of_this).map(Wanted::tail).collect();
                    let mut steps = Vec::new();
                    self.message(name, &within, false, depth + 1, &mut steps)?;
                    own.push((index, steps));
                }
                out.push(Step::Each { length, wanted: own, others });
                Ok(())
            }
        }
    }

    fn number(
        &mut self,
        number: Number,
        shape: Shape,
        wanted: &[Wanted<'_>],
        out: &mut Vec<Step>,
    ) -> Result<(), DefinitionError> {
        if let Some(w) = wanted.iter().find(|w| w.rest.len() > 1) {
            return Err(DefinitionError::NoNumber(w.path.to_owned()));
        }
        let size = number.size();
        let length = match shape {
            Shape::One => {
                match wanted {
                    [] => push(out, Step::Skip { size, count: 1 }),
                    [first, others @ ..] => {
                        // the same field twice: a list of one element
                        if others.is_empty() {
                            out.push(Step::Take { number, slot: first.slot });
                        } else {
                            let wanted = wanted.iter().map(|w| (0, w.slot)).collect();
                            out.push(Step::Pick { number, length: Some(1), wanted });
                        }
                    }
                }
                return Ok(());
            }
            Shape::Array(length) => Some(length),
            Shape::Sequence => None,
        };
        match (wanted, length) {
            ([], Some(length)) => push(out, Step::Skip { size, count: length as usize }),
            ([], None) => out.push(Step::SkipList { size }),
            (wanted, length) => {
                let wanted =
                    wanted.iter().filter_map(|w| Some((w.rest[0].index?, w.slot))).collect();
                out.push(Step::Pick { number, length, wanted });
            }
        }
        Ok(())
    }
}

/// Adds a step, joined with the one before where both skip numbers of the same size.
fn push(out: &mut Vec<Step>, step: Step) {
    if let (Step::Skip { size, count }, Some(Step::Skip { size: before, count: total })) =
        (&step, out.last_mut())
        && *before == *size
    {
        *total = total.saturating_add(*count);
        return;
    }
    out.push(step);
}

fn set(slots: &mut Slots, slot: usize, value: f64) {
    if let Some(place) = slots.get_mut(slot) {
        *place = value;
    }
}

fn run<const LITTLE: bool>(
    steps: &[Step],
    at: &mut Cursor<'_, LITTLE>,
    slots: &mut Slots,
) -> Result<(), MessageError> {
    for step in steps {
        match step {
            Step::Skip { size, count } => at.take(*size, *count).map(drop)?,
            Step::SkipList { size } => {
                let count = at.count()?;
                at.take(*size, count)?;
            }
            Step::SkipText => at.text().map(drop)?,
            Step::Take { number, slot } => {
                set(slots, *slot, at.number(*number)?);
            }
            Step::Pick { number, length, wanted } => {
                let count = match length {
                    Some(length) => *length as usize,
                    None => at.count()?,
                };
                let size = number.size();
                let bytes = at.take(size, count)?;
                for (index, slot) in wanted {
                    let from = (*index as usize).saturating_mul(size);
                    if let Some(bytes) = bytes.get(from..from.saturating_add(size)) {
                        set(slots, *slot, number.read::<LITTLE>(bytes));
                    }
                }
            }
            Step::Each { length, wanted, others } => {
                let count = match length {
                    Some(length) => *length as usize,
                    None => at.count()?,
                };
                // each element has at least one byte, so a claim beyond the message ends at once
                for index in 0..count {
                    let own = wanted.iter().find(|(k, _)| *k as usize == index);
                    run(own.map_or(others, |(_, steps)| steps), at, slots)?;
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// The values 1, 2, ... of a message that has text, lists and alignment in it.
    fn message(little: bool) -> Vec<u8> {
        let mut bytes = vec![0, u8::from(little), 0, 0];
        let mut put = |raw: &[u8], size: usize| {
            let body = bytes.len() - 4;
            bytes.resize(4 + body.next_multiple_of(size), 0);
            if little {
                bytes.extend(raw.iter().rev());
            } else {
                bytes.extend(raw);
            }
        };
        put(&1_u8.to_be_bytes(), 1); // first
        put(&3_u32.to_be_bytes(), 4); // text
        [b'a', b'b', 0].iter().for_each(|b| put(&[*b], 1));
        put(&2.0_f64.to_be_bytes(), 8); // second
        put(&2_u32.to_be_bytes(), 4); // near
        for (name, value) in [(b'c', 3_i16), (b'd', 4)] {
            put(&2_u32.to_be_bytes(), 4);
            put(&[name], 1);
            put(&[0], 1);
            put(&value.to_be_bytes(), 2);
            put(&0_u32.to_be_bytes(), 4); // list
        }
        [5.0_f32, 6.0].iter().for_each(|v| put(&v.to_be_bytes(), 4)); // pair
        put(&7_u64.to_be_bytes(), 8); // last
        bytes
    }

    const TEXT: &str = "bool first\nstring text\nfloat64 second\nNear[] near\nfloat32[2] pair\n\
                        uint64 last\nwstring never\n====\nMSG: p/Near\nstring name\nint16 value\n\
                        float64[] list\n";

    #[test]
    fn numbers_are_found_behind_texts_lists_and_padding_in_both_byte_orders() {
        let definitions = Definitions::parse("p/Main", TEXT).unwrap();
        let paths = [
            "first",
            "second",
            "near[0].value",
            "near[1].value",
            "pair[0]",
            "pair[1]",
            "last",
            "last",
        ];
        let program = Program::new(&definitions, "p/Main", &paths).unwrap();
        for little in [true, false] {
            let mut slots = [0.0; SLOTS];
            let bytes = message(little);
            program.read(&bytes, &mut slots).unwrap();
            assert_eq!(slots[..8], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0], "{little}");
            // cut anywhere, the message is an error, not a panic
            for end in 0..bytes.len() {
                assert!(program.read(&bytes[..end], &mut slots).is_err(), "{end}");
            }
        }
        let absent = Program::new(&definitions, "p/Main", &["near[5].value", "near[1].list[0]"]);
        let mut slots = [0.0; SLOTS];
        absent.unwrap().read(&message(true), &mut slots).unwrap();
        assert!(slots[0].is_nan() && slots[1].is_nan());
    }

    #[test]
    fn paths_that_name_no_number_are_rejected_with_the_fields_there_are() {
        let definitions = Definitions::parse("p/Main", TEXT).unwrap();
        for (path, words) in [
            ("secnd", "p/Main has no field \"secnd\"; it has first, text, second"),
            ("near", "an index in brackets is needed"),
            ("near[0]", "near[0] is no number"),
            ("near[0].valu", "p/Near has no field \"valu\""),
            ("second.x", "second.x is no number"),
            ("second[1]", "only for a list"),
            ("pair[x]", "an index in brackets"),
            ("text", "text is no number"),
            ("never", "wstring"),
        ] {
            let error = Program::new(&definitions, "p/Main", &[path]).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn types_that_contain_each_other_end_with_an_error() {
        let own = Definitions::parse("p/A", "A a\nfloat64 x").unwrap();
        assert!(Program::new(&own, "p/A", &["x"]).is_err());
        let mut text = "float64 y\nT1 a\nT1 b\nfloat64 x\n".to_owned();
        for k in 1..30 {
            text += &format!("====\nMSG: p/T{k}\nT{n} a\nT{n} b\n", n = k + 1);
        }
        text += "====\nMSG: p/T30\nfloat64 z\n";
        let many = Definitions::parse("p/A", &text).unwrap();
        assert!(matches!(Program::new(&many, "p/A", &["x"]), Err(DefinitionError::TooLarge(_))));
        assert!(Program::new(&many, "p/A", &["y"]).is_ok());
    }

    #[test]
    fn a_list_that_claims_more_than_the_message_holds_ends_at_once() {
        let text = "Empty[] list\nfloat64[4294967295] many\nfloat64 x\n====\nMSG: p/Empty\n";
        let definitions = Definitions::parse("p/A", text).unwrap();
        let program = Program::new(&definitions, "p/A", &["x"]).unwrap();
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend(u32::MAX.to_le_bytes());
        let mut slots = [0.0; SLOTS];
        assert!(program.read(&bytes, &mut slots).is_err());
        bytes[4..].copy_from_slice(&0_u32.to_le_bytes());
        assert!(program.read(&bytes, &mut slots).is_err());
    }
}
