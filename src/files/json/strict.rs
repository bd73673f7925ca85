//! A deserializer that reads an object only from an object, and that keeps the found and the
//! expected of a value that does not fit.
//!
//! serde takes a list for a struct too, as the values of its keys in order: an empty list would be an
//! object without keys. It also hands an error on as one sentence. The wrappers here refuse such
//! lists, and give every visitor an error with two halves, which is set aside on its way through the
//! parser; the parser's own error then adds the position.

use super::mismatch::{Mismatch, ValueError};
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, MapAccess, SeqAccess, Unexpected,
    VariantAccess, Visitor,
};
use std::cell::RefCell;
use std::fmt;

/// The place for the mismatch that ends a deserialization.
pub(super) type MismatchSlot = RefCell<Option<Mismatch>>;

/// A part of a deserialization in which no list is taken for an object.
pub(super) struct Strict<'a, T> {
    inner: T,
    slot: &'a MismatchSlot,
}

impl<'a, T> Strict<'a, T> {
    /// A deserializer, seed or access that leaves its mismatch in the slot.
    pub(super) const fn new(inner: T, slot: &'a MismatchSlot) -> Self {
        Self { inner, slot }
    }
}

/// Sets a mismatch aside, and returns the error of the parser that stands for it.
fn set_aside<E: Error>(slot: &MismatchSlot, error: ValueError<E>) -> E {
    match error {
        ValueError::Parser(error) => error,
        ValueError::Mismatch(mismatch) => {
            let error = E::custom(&mismatch.found);
            slot.replace(Some(mismatch));
            error
        }
    }
}

/// A visitor with the words for what it accepts, where the visitor itself would name a type of the
/// program.
struct StrictVisitor<'a, V> {
    inner: V,
    slot: &'a MismatchSlot,
    accepts: Option<&'static str>,
    /// True if the visitor reads a struct, which a list is not passed on to.
    object: bool,
}

impl<'a, V> StrictVisitor<'a, V> {
    const fn new(inner: V, slot: &'a MismatchSlot, accepts: Option<&'static str>) -> Self {
        Self { inner, slot, accepts, object: false }
    }

    const fn of_object(inner: V, slot: &'a MismatchSlot) -> Self {
        Self { inner, slot, accepts: Some(OBJECT), object: true }
    }
}

impl<V> StrictVisitor<'_, V> {
    /// The value of the visitor, or the error of the parser that stands for its mismatch.
    fn settle<T, E: Error>(
        value: Result<T, ValueError<E>>,
        slot: &MismatchSlot,
        accepts: Option<&'static str>,
    ) -> Result<T, E> {
        let value = value.map_err(|error| match accepts {
            Some(accepted) => error.expecting(accepted),
            None => error,
        });
        value.map_err(|error| set_aside(slot, error))
    }
}

/// An accepted object, in messages.
const OBJECT: &str = "an object with its keys: {\"key\": ...}";

/// An accepted number of something, in messages.
const COUNT: &str = "a whole number, 0 or more";

/// Methods of a deserializer that hand a visitor on, with the words for what it accepts. The parser
/// is asked for any value where JSON tells the kinds apart, so that the visitor judges it.
macro_rules! pass_on {
    ($($method:ident($($name:ident: $kind:ty),*) => $inner:ident($($argument:ident),*), $accepts:expr;)*) => {
        $(fn $method<V: Visitor<'de>>(
            self,
            $($name: $kind,)*
            visitor: V,
        ) -> Result<V::Value, Self::Error> {
            let visitor = StrictVisitor::new(visitor, self.slot, $accepts);
            self.inner.$inner($($argument,)* visitor).map_err(ValueError::Parser)
        })*
    };
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Strict<'_, D> {
    type Error = ValueError<D::Error>;

    pass_on! {
        deserialize_any() => deserialize_any(), None;
        deserialize_bool() => deserialize_any(), Some("true or false");
        deserialize_i8() => deserialize_any(), Some("a whole number");
        deserialize_i16() => deserialize_any(), Some("a whole number");
        deserialize_i32() => deserialize_any(), Some("a whole number");
        deserialize_i64() => deserialize_any(), Some("a whole number");
        deserialize_i128() => deserialize_i128(), Some("a whole number");
        deserialize_u8() => deserialize_any(), Some(COUNT);
        deserialize_u16() => deserialize_any(), Some(COUNT);
        deserialize_u32() => deserialize_any(), Some(COUNT);
        deserialize_u64() => deserialize_any(), Some(COUNT);
        deserialize_u128() => deserialize_u128(), Some(COUNT);
        deserialize_f32() => deserialize_any(), Some("a number");
        deserialize_f64() => deserialize_any(), Some("a number");
        deserialize_char() => deserialize_any(), None;
        deserialize_str() => deserialize_any(), Some("a string");
        deserialize_string() => deserialize_any(), Some("a string");
        deserialize_bytes() => deserialize_bytes(), None;
        deserialize_byte_buf() => deserialize_byte_buf(), None;
        deserialize_option() => deserialize_option(), None;
        deserialize_unit() => deserialize_any(), None;
        deserialize_seq() => deserialize_any(), Some("a list");
        deserialize_map() => deserialize_any(), None;
        deserialize_identifier() => deserialize_identifier(), None;
        deserialize_ignored_any() => deserialize_ignored_any(), None;
        deserialize_unit_struct(name: &'static str) => deserialize_unit_struct(name), None;
        deserialize_newtype_struct(name: &'static str) => deserialize_newtype_struct(name), None;
        deserialize_tuple(_len: usize) => deserialize_any(), None;
        deserialize_tuple_struct(_name: &'static str, _len: usize) => deserialize_any(), None;
        deserialize_enum(name: &'static str, variants: &'static [&'static str])
            => deserialize_enum(name, variants), None;
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Self::Error> {
        let visitor = StrictVisitor::of_object(visitor, self.slot);
        self.inner.deserialize_any(visitor).map_err(ValueError::Parser)
    }

    fn is_human_readable(&self) -> bool {
        self.inner.is_human_readable()
    }
}

/// Methods of a visitor that are passed on with their plain value.
macro_rules! pass_value {
    ($($method:ident: $kind:ty,)*) => {
        $(fn $method<E: Error>(self, value: $kind) -> Result<V::Value, E> {
            Self::settle(self.inner.$method(value), self.slot, self.accepts)
        })*
    };
}

/// Methods of a visitor that are passed on with a wrapped part of the parser.
macro_rules! pass_part {
    ($($method:ident: $kind:ident,)*) => {
        $(fn $method<A: $kind<'de>>(self, part: A) -> Result<V::Value, A::Error> {
            let value = self.inner.$method(Strict::new(part, self.slot));
            Self::settle(value, self.slot, self.accepts)
        })*
    };
}

impl<'de, V: Visitor<'de>> Visitor<'de> for StrictVisitor<'_, V> {
    type Value = V::Value;

    pass_value! {
        visit_bool: bool, visit_i8: i8, visit_i16: i16, visit_i32: i32, visit_i64: i64,
        visit_i128: i128, visit_u8: u8, visit_u16: u16, visit_u32: u32, visit_u64: u64,
        visit_u128: u128, visit_f32: f32, visit_f64: f64, visit_char: char, visit_str: &str,
        visit_borrowed_str: &'de str, visit_string: String, visit_bytes: &[u8],
        visit_borrowed_bytes: &'de [u8], visit_byte_buf: Vec<u8>,
    }

    pass_part! {
        visit_some: Deserializer, visit_newtype_struct: Deserializer, visit_map: MapAccess,
        visit_enum: EnumAccess,
    }

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.inner.expecting(f)
    }

    fn visit_none<E: Error>(self) -> Result<V::Value, E> {
        Self::settle(self.inner.visit_none(), self.slot, self.accepts)
    }

    fn visit_unit<E: Error>(self) -> Result<V::Value, E> {
        Self::settle(self.inner.visit_unit(), self.slot, self.accepts)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<V::Value, A::Error> {
        let value = if self.object {
            Err(ValueError::invalid_type(Unexpected::Seq, &self.inner))
        } else {
            self.inner.visit_seq(Strict::new(list, self.slot))
        };
        Self::settle(value, self.slot, self.accepts)
    }
}

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Strict<'_, S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<S::Value, D::Error> {
        let value = self.inner.deserialize(Strict::new(from, self.slot));
        value.map_err(|error| set_aside(self.slot, error))
    }
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for Strict<'_, A> {
    type Error = ValueError<A::Error>;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Self::Error> {
        let seed = Strict::new(seed, self.slot);
        self.inner.next_element_seed(seed).map_err(ValueError::Parser)
    }

    fn size_hint(&self) -> Option<usize> {
        self.inner.size_hint()
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Strict<'_, A> {
    type Error = ValueError<A::Error>;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Self::Error> {
        let seed = Strict::new(seed, self.slot);
        self.inner.next_key_seed(seed).map_err(ValueError::Parser)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<S::Value, Self::Error> {
        let seed = Strict::new(seed, self.slot);
        self.inner.next_value_seed(seed).map_err(ValueError::Parser)
    }

    fn size_hint(&self) -> Option<usize> {
        self.inner.size_hint()
    }
}

impl<'de, 'a, A: EnumAccess<'de>> EnumAccess<'de> for Strict<'a, A> {
    type Error = ValueError<A::Error>;
    type Variant = Strict<'a, A::Variant>;

    fn variant_seed<S: DeserializeSeed<'de>>(
        self,
        seed: S,
    ) -> Result<(S::Value, Self::Variant), Self::Error> {
        let seed = Strict::new(seed, self.slot);
        let (value, variant) = self.inner.variant_seed(seed).map_err(ValueError::Parser)?;
        Ok((value, Strict::new(variant, self.slot)))
    }
}

impl<'de, A: VariantAccess<'de>> VariantAccess<'de> for Strict<'_, A> {
    type Error = ValueError<A::Error>;

    fn unit_variant(self) -> Result<(), Self::Error> {
        self.inner.unit_variant().map_err(ValueError::Parser)
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(
        self,
        seed: S,
    ) -> Result<S::Value, Self::Error> {
        let seed = Strict::new(seed, self.slot);
        self.inner.newtype_variant_seed(seed).map_err(ValueError::Parser)
    }

    fn tuple_variant<V: Visitor<'de>>(
        self,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Self::Error> {
        self.newtype_variant_seed(TupleSeed(len, visitor))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Self::Error> {
        self.newtype_variant_seed(ObjectSeed(fields, visitor))
    }
}

/// The content of a named variant: a list of so many values.
struct TupleSeed<V>(usize, V);

impl<'de, V: Visitor<'de>> DeserializeSeed<'de> for TupleSeed<V> {
    type Value = V::Value;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<V::Value, D::Error> {
        from.deserialize_tuple(self.0, self.1)
    }
}

/// The content of a named variant: an object with these keys.
struct ObjectSeed<V>(&'static [&'static str], V);

impl<'de, V: Visitor<'de>> DeserializeSeed<'de> for ObjectSeed<V> {
    type Value = V::Value;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<V::Value, D::Error> {
        from.deserialize_struct("", self.0, self.1)
    }
}
