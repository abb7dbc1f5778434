//! A step of the filter as a linear map of the error, and its products.

/// A linear map of the error, `M = 1 + E`, by the rows in which `E` is not zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Map {
    /// Rows that differ from the identity, and the place of each row of the matrix among them.
    rows: Vec<usize>,
    places: Vec<usize>,
    /// Elements of `E` beside the diagonal, and the diagonal of these rows: place of the row,
    /// column, value.
    elements: Vec<(usize, usize, f64)>,
    diagonal: Vec<f64>,
    /// One row for each changed row.
    work: Vec<f64>,
}

/// No row of the matrix differs from the identity there.
const UNCHANGED: usize = usize::MAX;

impl Map {
    /// Identity of dimension `n`.
    pub(super) fn identity(n: usize) -> Self {
        Self { places: vec![UNCHANGED; n], ..Self::default() }
    }

    /// Sets the map to the elements of the rows that differ from the identity.
    pub(super) fn set(&mut self, elements: impl Iterator<Item = (usize, usize, f64)>) {
        self.rows.iter().for_each(|row| self.places[*row] = UNCHANGED);
        self.rows.clear();
        self.elements.clear();
        self.diagonal.clear();
        for (i, j, value) in elements {
            if self.places[i] == UNCHANGED {
                self.places[i] = self.rows.len();
                self.rows.push(i);
                self.diagonal.push(-1.0);
            }
            if i == j {
                self.diagonal[self.places[i]] += value;
            } else if value != 0.0 {
                self.elements.push((self.places[i], j, value));
            }
        }
        let diagonal = self.rows.iter().zip(&self.diagonal).enumerate();
        let diagonal = diagonal.map(|(place, (row, value))| (place, *row, *value));
        self.elements.extend(diagonal.filter(|(_, _, value)| *value != 0.0));
    }

    /// `X = M' X`, with rows of `width`.
    pub(super) fn carry(&mut self, x: &mut [f64], width: usize) {
        self.work.clear();
        for row in &self.rows {
            self.work.extend_from_slice(&x[row * width..][..width]);
        }
        for &(place, j, value) in &self.elements {
            add(&mut x[j * width..][..width], value, &self.work[place * width..][..width]);
        }
    }

    /// `X = M' X M` of a symmetric matrix.
    ///
    /// With the rows `W = X[R, :]` that meet `E`, `X + E' W + W' E + E' X E` is `X + Z + Z'` with
    /// `Z = E' V` and `V = W + X[R, R] E / 2`: the products touch only the elements of `E`, and the
    /// result is symmetric to the bit.
    pub(super) fn congruence(&mut self, x: &mut [f64], z: &mut [f64]) {
        let n = self.places.len();
        self.work.clear();
        for row in &self.rows {
            self.work.extend_from_slice(&x[row * n..][..n]);
        }
        for (row, v) in self.rows.iter().zip(self.work.chunks_exact_mut(n)) {
            let x = &x[row * n..][..n];
            for &(place, j, value) in &self.elements {
                v[j] += 0.5 * x[self.rows[place]] * value;
            }
        }
        z.fill(0.0);
        for &(place, j, value) in &self.elements {
            add(&mut z[j * n..][..n], value, &self.work[place * n..][..n]);
        }
        for i in 0..n {
            for j in 0..i {
                let sum = x[i * n + j] + (z[i * n + j] + z[j * n + i]);
                x[i * n + j] = sum;
                x[j * n + i] = sum;
            }
            x[i * n + i] += 2.0 * z[i * n + i];
        }
    }
}

/// `a += f b`.
#[inline]
pub(super) fn add(a: &mut [f64], f: f64, b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += f * b;
    }
}
