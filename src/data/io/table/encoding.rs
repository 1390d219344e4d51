//! From the bytes of a file to its text.

use std::borrow::Cow;

/// The format of a file that is not text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotText {
    /// FITS.
    Fits,
    /// NumPy, one array.
    Numpy,
    /// Packed by gzip, bzip2 or xz.
    Compressed,
    /// A zip archive: spreadsheets, and several NumPy arrays.
    Zip,
    /// HDF5.
    Hdf5,
    /// XML, such as VOTables.
    Xml,
    /// Anything else.
    Binary,
}

impl std::fmt::Display for NotText {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            NotText::Fits => "a FITS file",
            NotText::Numpy => "a NumPy file",
            NotText::Compressed => "a compressed file",
            NotText::Zip => "a zip archive (a spreadsheet, or NumPy arrays)",
            NotText::Hdf5 => "an HDF5 file",
            NotText::Xml => "XML (a VOTable?)",
            NotText::Binary => "a binary file",
        })
    }
}

/// First bytes of files that are not text.
const BEGINNINGS: [(&[u8], NotText); 9] = [
    (b"SIMPLE  =", NotText::Fits),
    (b"\x93NUMPY", NotText::Numpy),
    (b"\x1f\x8b", NotText::Compressed),
    (b"BZh", NotText::Compressed),
    (b"\xfd7zXZ\0", NotText::Compressed),
    (b"PK\x03\x04", NotText::Zip),
    (b"\x89HDF\r\n\x1a\n", NotText::Hdf5),
    (b"<?xml", NotText::Xml),
    (b"<VOTABLE", NotText::Xml),
];

/// The byte-order mark of some editors, and other invisible characters.
const UNSEEN: [char; 2] = ['\u{feff}', '\u{200b}'];

/// The text of a file: UTF-8, or UTF-16 after its mark; line ends become `\n`. Marks and zero-width characters are left
/// out; invalid UTF-8 is replaced, which is harmless in comments.
///
/// # Errors
/// A file that is not text.
pub fn text(bytes: &[u8]) -> Result<Cow<'_, str>, NotText> {
    if let Some((_, what)) = BEGINNINGS.iter().find(|(beginning, _)| bytes.starts_with(beginning)) {
        return Err(*what);
    }
    let wide = |of: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| of([pair[0], pair[1]])).collect();
        Cow::Owned(String::from_utf16_lossy(&units))
    };
    let mut text = match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes),
    };
    if text.contains('\0') {
        return Err(NotText::Binary);
    }
    if text.contains(UNSEEN) {
        text = Cow::Owned(text.replace(UNSEEN, ""));
    }
    if text.contains('\r') {
        text = Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n"));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_text_in_any_encoding() {
        let plain = "time,flux\n1,2\n";
        let wide = |of: fn(u16) -> [u8; 2]| -> Vec<u8> {
            "\u{feff}time,flux\r\n1,2\r\n".encode_utf16().flat_map(of).collect()
        };
        let read = |bytes: &[u8]| text(bytes).map(Cow::into_owned);
        assert_eq!(read(plain.as_bytes()).unwrap(), plain);
        assert_eq!(read("\u{feff}time,\u{200b}flux\n1,2\n".as_bytes()).unwrap(), plain);
        assert_eq!(read(b"time,flux\r1,2\r").unwrap(), plain);
        assert_eq!(read(&wide(u16::to_le_bytes)).unwrap(), plain);
        assert_eq!(read(&wide(u16::to_be_bytes)).unwrap(), plain);
        assert_eq!(read(b"# \xe9toile\n1 2\n").unwrap(), "# \u{fffd}toile\n1 2\n");
    }

    #[test]
    fn what_is_no_text_is_named() {
        assert_eq!(text(b"SIMPLE  =                    T"), Err(NotText::Fits));
        assert_eq!(text(b"\x93NUMPY\x01\0v\0{'descr'"), Err(NotText::Numpy));
        assert_eq!(text(b"\x1f\x8b\x08\0"), Err(NotText::Compressed));
        assert_eq!(text(b"\x01\x02\0\0"), Err(NotText::Binary));
        assert_eq!(NotText::Fits.to_string(), "a FITS file");
    }
}
