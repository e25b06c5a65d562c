//! PLY and PCD as other readers see them: the header alone says what the columns are. Shares no
//! code with the library.

use std::collections::BTreeMap;

/// Columns by name, in double precision.
pub(crate) type Columns = BTreeMap<String, Vec<f64>>;

struct Header {
    /// Name and bytes of each column.
    columns: Vec<(String, usize)>,
    points: usize,
    is_text: bool,
    comments: Vec<String>,
}

/// The text up to and including the line that begins so, and the rest.
fn split<'a>(file: &'a [u8], last: &str) -> (String, &'a [u8]) {
    let mut at = 0;
    for line in file.split_inclusive(|&byte| byte == b'\n') {
        at += line.len();
        if line.starts_with(last.as_bytes()) {
            return (String::from_utf8(file[..at].to_vec()).expect("a header of text"), &file[at..]);
        }
    }
    panic!("the header does not end");
}

/// A PLY file, binary little endian or ascii: its vertices and its comments.
pub(crate) fn ply(file: &[u8]) -> (Columns, Vec<String>) {
    let (text, data) = split(file, "end_header");
    let mut header = Header { columns: Vec::new(), points: 0, is_text: false, comments: Vec::new() };
    for line in text.lines() {
        let words: Vec<_> = line.split(' ').collect();
        match words[..] {
            ["format", format, "1.0"] => header.is_text = format == "ascii",
            ["element", "vertex", points] => header.points = points.parse().expect("a number"),
            ["property", "float", name] => header.columns.push((name.to_owned(), 4)),
            ["property", "uchar", name] => header.columns.push((name.to_owned(), 1)),
            ["comment", ..] => header.comments.push(line["comment ".len()..].to_owned()),
            ["ply" | "end_header"] => {}
            _ => panic!("{line}"),
        }
    }
    (columns(&header, data), header.comments)
}

/// A binary PCD file: its points and its comments.
pub(crate) fn pcd(file: &[u8]) -> (Columns, Vec<String>) {
    let (text, data) = split(file, "DATA binary");
    let row = |key: &str| -> Vec<String> {
        let line = text.lines().find(|line| line.starts_with(key)).expect(key);
        line.split(' ').skip(1).map(str::to_owned).collect()
    };
    let (sizes, types) = (row("SIZE "), row("TYPE "));
    for (size, kind) in sizes.iter().zip(&types) {
        assert!(matches!((size.as_str(), kind.as_str()), ("4", "F") | ("1", "U")), "{kind}{size}");
    }
    let sizes = sizes.iter().map(|size| size.parse().expect("a number"));
    let header = Header {
        columns: row("FIELDS ").into_iter().zip(sizes).collect(),
        points: row("POINTS ")[0].parse().expect("a number"),
        is_text: false,
        comments: text.lines().filter_map(|line| line.strip_prefix("# ")).map(str::to_owned).collect(),
    };
    (columns(&header, data), header.comments)
}

fn columns(header: &Header, data: &[u8]) -> Columns {
    let mut columns: Columns = header.columns.iter().map(|(name, _)| (name.clone(), Vec::new())).collect();
    let mut push = |name: &str, value: f64| columns.get_mut(name).expect("a column").push(value);
    if header.is_text {
        for line in std::str::from_utf8(data).expect("text").lines() {
            let words: Vec<_> = line.split(' ').collect();
            assert_eq!(words.len(), header.columns.len(), "{line}");
            for ((name, size), word) in header.columns.iter().zip(words) {
                let value: f32 = word.parse().expect("a number");
                assert!(*size == 4 || value.fract() == 0.0, "{line}");
                push(name, f64::from(value));
            }
        }
    } else {
        let mut rest = data;
        for _ in 0..header.points {
            for (name, size) in &header.columns {
                let (value, after) = rest.split_at(*size);
                rest = after;
                push(
                    name,
                    match value {
                        [byte] => f64::from(*byte),
                        _ => f64::from(f32::from_le_bytes(value.try_into().expect("4 bytes"))),
                    },
                );
            }
        }
        assert!(rest.is_empty(), "more data than points");
    }
    assert!(columns.values().all(|column| column.len() == header.points), "fewer data than points");
    columns
}
