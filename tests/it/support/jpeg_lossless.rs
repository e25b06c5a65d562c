//! Writes JPEG Lossless streams, from ISO/IEC 10918-1 annexes B, C and H: the other side of the
//! decoder, which shares nothing with it.

/// How a stream is written.
#[derive(Debug, Clone)]
pub(crate) struct Encoding {
    /// Bits of a sample, 2 to 16.
    pub(crate) precision: u32,
    /// Which predictor, 1 to 7.
    pub(crate) selection: u8,
    pub(crate) point_transform: u32,
    /// Rows between restart markers; 0: none.
    pub(crate) restart_rows: usize,
    pub(crate) codes: Codes,
    /// Comments, fill bytes before markers, tables that nobody uses.
    pub(crate) ornate: bool,
}

/// Which Huffman table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Codes {
    /// 17 codes of 5 bits.
    Flat,
    /// Codes of 1 to 16 bits, the shortest for the category 0; the last is all ones.
    ShortFirst,
    /// The shortest for the category 16.
    ShortLast,
}

impl Codes {
    /// Length of the code of each category, and the categories in the order of their codes.
    fn lengths(self) -> [(usize, u8); 17] {
        std::array::from_fn(|i| match self {
            Self::Flat => (5, i as u8),
            Self::ShortFirst => ((i + 1).min(16), i as u8),
            Self::ShortLast => ((i + 1).min(16), 16 - i as u8),
        })
    }
}

/// What a decoder must give back for the samples: those that the point transform leaves.
pub(crate) fn expected(samples: &[u16], point_transform: u32) -> Vec<u16> {
    samples.iter().map(|sample| sample >> point_transform << point_transform).collect()
}

/// One component of `samples`, each of fewer bits than the precision.
pub(crate) fn encode(samples: &[u16], columns: usize, encoding: &Encoding) -> Vec<u8> {
    let rows = samples.len() / columns;
    let mut stream = vec![0xFF, 0xD8];
    if encoding.ornate {
        stream.extend([0xFF, 0xE0, 0, 6, b'L', b'J', b'I', b'F']);
        stream.extend([0xFF, 0xFE, 0, 5, 0xFF, 0xC3, 0xFF]);
        // A table of class 1 and another one in the same place, which the next one replaces.
        stream.extend([0xFF, 0xC4, 0, 38, 0x13, 1]);
        stream.extend([0; 15]);
        stream.extend([0x11, 0, 1]);
        stream.extend([0; 15]);
        stream.push(0);
        stream.extend([0xFF; 3]);
    }
    let lengths = encoding.codes.lengths();
    stream.extend([0xFF, 0xC4, 0, 2 + 17 + 17, 0]);
    stream.extend((1..=16).map(|bits| lengths.iter().filter(|(length, _)| *length == bits).count() as u8));
    stream.extend(lengths.iter().map(|(_, category)| *category));
    stream.extend([0xFF, 0xC3, 0, 11, encoding.precision as u8]);
    stream.extend((rows as u16).to_be_bytes());
    stream.extend((columns as u16).to_be_bytes());
    stream.extend([1, 7, 0x11, 0]);
    if encoding.restart_rows > 0 {
        stream.extend([0xFF, 0xDD, 0, 4]);
        stream.extend(((encoding.restart_rows * columns) as u16).to_be_bytes());
    }
    stream.extend([0xFF, 0xDA, 0, 8, 1, 7, 0, encoding.selection, 0, encoding.point_transform as u8]);

    let codes = codes(&lengths);
    let rows_of_interval = if encoding.restart_rows == 0 { rows } else { encoding.restart_rows };
    for (index, interval) in samples.chunks(rows_of_interval * columns).enumerate() {
        if index > 0 {
            if encoding.ornate {
                stream.push(0xFF);
            }
            stream.extend([0xFF, 0xD0 + ((index - 1) % 8) as u8]);
        }
        let mut bits = Bits::default();
        for difference in differences(interval, columns, encoding) {
            let magnitude = u32::from(difference.unsigned_abs());
            let category = (u32::BITS - magnitude.leading_zeros()) as usize;
            let (code, length) = codes[category];
            bits.put(code, length);
            if (1..16).contains(&category) {
                let additional = if difference > 0 { magnitude } else { (1 << category) - 1 - magnitude };
                bits.put(additional, category);
            }
        }
        stream.extend(bits.bytes());
    }
    stream.extend([0xFF, 0xD9]);
    stream
}

/// Code and length by category.
fn codes(lengths: &[(usize, u8); 17]) -> [(u32, usize); 17] {
    let mut codes = [(0, 0); 17];
    let (mut code, mut previous) = (0, lengths[0].0);
    for (length, category) in lengths {
        code <<= length - previous;
        codes[usize::from(*category)] = (code, *length);
        (code, previous) = (code + 1, *length);
    }
    codes
}

/// Differences from the prediction, −32768 (for 32768) to 32767.
fn differences(samples: &[u16], columns: usize, encoding: &Encoding) -> Vec<i16> {
    let at =
        |row: usize, column: usize| i64::from(samples[row * columns + column] >> encoding.point_transform);
    (0..samples.len())
        .map(|index| {
            let (row, column) = (index / columns, index % columns);
            let prediction = match (row, column) {
                (0, 0) => 1 << (encoding.precision - encoding.point_transform - 1),
                (0, _) => at(0, column - 1),
                (_, 0) => at(row - 1, 0),
                _ => {
                    let (a, b, c) = (at(row, column - 1), at(row - 1, column), at(row - 1, column - 1));
                    match encoding.selection {
                        1 => a,
                        2 => b,
                        3 => c,
                        4 => a + b - c,
                        5 => a + (b - c).div_euclid(2),
                        6 => b + (a - c).div_euclid(2),
                        _ => (a + b) / 2,
                    }
                }
            };
            (at(row, column) - prediction) as i16
        })
        .collect()
}

/// Bits, the first one highest.
#[derive(Default)]
struct Bits(Vec<bool>);

impl Bits {
    fn put(&mut self, value: u32, length: usize) {
        self.0.extend((0..length).rev().map(|bit| value >> bit & 1 == 1));
    }

    /// Filled up with ones, a zero after each byte FF.
    fn bytes(mut self) -> Vec<u8> {
        self.0.resize(self.0.len().next_multiple_of(8), true);
        let byte = |bits: &[bool]| bits.iter().fold(0_u8, |byte, bit| byte << 1 | u8::from(*bit));
        self.0
            .chunks(8)
            .map(byte)
            .flat_map(|byte| [Some(byte), (byte == 0xFF).then_some(0)])
            .flatten()
            .collect()
    }
}
