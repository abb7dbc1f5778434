//! Numbers, texts and collections in a checkpoint.

use super::io::{Io, Saved};
use nalgebra::{Quaternion, Rotation3, SMatrix, UnitQuaternion};
use std::collections::VecDeque;

/// Numbers as their bytes, the least first: a float keeps every bit, also of a NaN.
macro_rules! numbers {
    ($($type:ty),+) => {
        $(impl Saved for $type {
            fn saved(&mut self, io: &mut Io<'_>) {
                let mut bytes = self.to_le_bytes();
                io.bytes(&mut bytes);
                *self = Self::from_le_bytes(bytes);
            }
        })+
    };
}

numbers!(u8, u16, u32, u64, i32, i64, f32, f64);

impl Saved for bool {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut byte = u8::from(*self);
        io.pass(&mut byte);
        *self = byte != 0;
    }
}

impl Saved for usize {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut number = *self as u64;
        io.pass(&mut number);
        match Self::try_from(number) {
            Ok(number) => *self = number,
            Err(_) => io.fail(format!("{number} is beyond this machine")),
        }
    }
}

impl Saved for String {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut bytes = std::mem::take(self).into_bytes();
        io.pass(&mut bytes);
        match Self::from_utf8(bytes) {
            Ok(text) => *self = text,
            Err(_) => io.fail("a text is not UTF-8"),
        }
    }
}

impl<T: Saved + Default> Saved for Option<T> {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut there = self.is_some();
        io.pass(&mut there);
        match there {
            true => io.pass(self.get_or_insert_default()),
            false => *self = None,
        }
    }
}

impl<T: Saved + Default> Saved for Vec<T> {
    fn saved(&mut self, io: &mut Io<'_>) {
        let count = io.count(self.len());
        // one by one: the bytes bound the count, and a value may be larger than its bytes
        self.truncate(count);
        self.iter_mut().for_each(|value| io.pass(value));
        for _ in self.len()..count {
            let mut value = T::default();
            io.pass(&mut value);
            self.push(value);
        }
    }
}

impl<T: Saved + Default> Saved for VecDeque<T> {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut values = Vec::from(std::mem::take(self));
        io.pass(&mut values);
        *self = values.into();
    }
}

impl<T: Saved, const N: usize> Saved for [T; N] {
    fn saved(&mut self, io: &mut Io<'_>) {
        self.iter_mut().for_each(|value| io.pass(value));
    }
}

impl<T: Saved + ?Sized> Saved for Box<T> {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.pass(&mut **self);
    }
}

macro_rules! tuples {
    ($(($($name:ident),+)),+) => {
        $(impl<$($name: Saved),+> Saved for ($($name,)+) {
            fn saved(&mut self, io: &mut Io<'_>) {
                #[allow(non_snake_case, reason = "a value has the name of its type")]
                let ($($name,)+) = self;
                $(io.pass($name);)+
            }
        })+
    };
}

tuples!((A, B), (A, B, C));

impl<const R: usize, const C: usize> Saved for SMatrix<f64, R, C> {
    fn saved(&mut self, io: &mut Io<'_>) {
        self.iter_mut().for_each(|value| io.pass(value));
    }
}

impl Saved for Rotation3<f64> {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut matrix = self.into_inner();
        io.pass(&mut matrix);
        *self = Self::from_matrix_unchecked(matrix);
    }
}

impl Saved for UnitQuaternion<f64> {
    fn saved(&mut self, io: &mut Io<'_>) {
        let mut coordinates = self.into_inner().coords;
        io.pass(&mut coordinates);
        *self = Self::new_unchecked(Quaternion::from(coordinates));
    }
}
