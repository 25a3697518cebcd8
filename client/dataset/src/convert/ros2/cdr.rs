//! Plain CDR, little-endian, as every ROS 2 middleware reads it: each value is located
//! at a multiple of its own size, counted from after the four bytes of the head.

/// Head of the encoding: plain CDR, little-endian, no options.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// A message that is being encoded.
#[derive(Debug)]
pub(in crate::convert) struct Cdr(Vec<u8>);

impl Cdr {
    pub fn new() -> Self {
        Self(HEAD.to_vec())
    }

    /// The encoded message with its head.
    pub fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        self.align(N);
        self.0.extend_from_slice(&bytes);
    }

    fn align(&mut self, size: usize) {
        let length = (self.0.len() - HEAD.len()).next_multiple_of(size);
        self.0.resize(HEAD.len() + length, 0);
    }

    pub fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    pub fn bool(&mut self, value: bool) {
        self.put([u8::from(value)]);
    }

    pub fn i32(&mut self, value: i32) {
        self.put(value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    pub fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }

    /// An array of fixed length, which is not written.
    pub fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|&value| self.f64(value));
    }

    /// Length of a sequence.
    ///
    /// # Panics
    /// Beyond 2³² elements: no message of ours gets near.
    pub fn length(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("a sequence of fewer than 2^32 elements"));
    }

    /// A sequence: its length, then its elements.
    pub fn f64_sequence(&mut self, values: &[f64]) {
        self.length(values.len());
        self.f64s(values);
    }

    /// Single precision.
    pub fn f32(&mut self, value: f32) {
        self.put(value.to_le_bytes());
    }

    /// A sequence in single precision.
    pub fn f32_sequence(&mut self, values: &[f32]) {
        self.length(values.len());
        values.iter().for_each(|&value| self.f32(value));
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.0.extend_from_slice(bytes);
    }

    /// A text: its length with the NUL that ends it, then both. The value behind
    /// a NUL inside would be lost to readers; there it is cut.
    pub fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.length(text.len() + 1);
        self.0.extend_from_slice(text.as_bytes());
        self.0.push(0);
    }

    /// A sequence of texts.
    pub fn texts(&mut self, texts: &[String]) {
        self.length(texts.len());
        texts.iter().for_each(|text| self.text(text));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bytes after the head.
    fn encoded(write: impl Fn(&mut Cdr)) -> Vec<u8> {
        let mut out = Cdr::new();
        write(&mut out);
        let bytes = out.into_bytes();
        assert_eq!(bytes[..4], HEAD);
        bytes[4..].to_vec()
    }

    #[test]
    fn values_are_aligned_to_their_size_after_the_header() {
        let bytes = encoded(|out| {
            out.u8(7);
            out.u32(0x0102_0304);
            out.f64(1.0);
            out.bool(true);
            out.i32(-2);
        });
        let mut wanted = vec![7, 0, 0, 0, 4, 3, 2, 1];
        wanted.extend(1.0_f64.to_le_bytes());
        wanted.extend([1, 0, 0, 0, 0xfe, 0xff, 0xff, 0xff]);
        assert_eq!(bytes, wanted);
        // The header does not count: eight bytes follow it without padding.
        assert_eq!(encoded(|out| out.f64(2.0)), 2.0_f64.to_le_bytes());
    }

    #[test]
    fn a_text_has_its_nul_in_its_length_and_ends_unaligned() {
        let bytes = encoded(|out| {
            out.text("ab");
            out.u8(9);
            out.text("");
        });
        assert_eq!(
            bytes,
            [3, 0, 0, 0, b'a', b'b', 0, 9, 1, 0, 0, 0, 0],
            "{bytes:?}"
        );
        assert_eq!(encoded(|out| out.text("a\0b")), [2, 0, 0, 0, b'a', 0]);
    }

    #[test]
    fn arrays_have_no_length_and_sequences_do() {
        let array = encoded(|out| out.f64s(&[1.0, 2.0]));
        let sequence = encoded(|out| out.f64_sequence(&[1.0, 2.0]));
        assert_eq!(array.len(), 16);
        // Length, room up to a multiple of eight, two numbers.
        assert_eq!(sequence[..8], [2, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(sequence[8..], array);
        // An empty list has neither elements nor padding.
        assert_eq!(encoded(|out| out.f64_sequence(&[])), [0; 4]);
        let texts = encoded(|out| out.texts(&["a".into(), "bc".into()]));
        let wanted = [
            2, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 3, 0, 0, 0, b'b', b'c', 0,
        ];
        assert_eq!(texts, wanted);
        let bytes = encoded(|out| {
            out.bytes(&[5, 6, 7]);
            out.u32(1);
        });
        assert_eq!(bytes, [3, 0, 0, 0, 5, 6, 7, 0, 1, 0, 0, 0]);
    }
}
