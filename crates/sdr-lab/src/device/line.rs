//! Lines out of a stream, with a bound.

/// A line was longer than allowed.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct LineError;

/// Keeps what came until its line is whole.
#[derive(Debug, Default)]
pub(crate) struct LineBuffer {
    bytes: Vec<u8>,
}

impl LineBuffer {
    /// Takes bytes as they came.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole line without its end.
    pub(crate) fn next_line(&mut self) -> Result<Option<Vec<u8>>, LineError> {
        let end = self.bytes.iter().take(super::LINE_BYTES_MAX).position(|&byte| byte == b'\n');
        match end {
            Some(end) => {
                let mut line: Vec<u8> = self.bytes.drain(..=end).collect();
                line.pop();
                Ok(Some(line))
            }
            None if self.bytes.len() >= super::LINE_BYTES_MAX => Err(LineError),
            None => Ok(None),
        }
    }

    /// What came after the last whole line.
    pub(crate) fn take_rest(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_whole_however_they_were_cut() {
        let mut buffer = LineBuffer::default();
        buffer.push(b"on");
        assert_eq!(buffer.next_line(), Ok(None));

        buffer.push(b"e\ntwo\nthr");

        assert_eq!(buffer.next_line(), Ok(Some(b"one".to_vec())));
        assert_eq!(buffer.next_line(), Ok(Some(b"two".to_vec())));
        assert_eq!(buffer.next_line(), Ok(None));
        assert_eq!(buffer.take_rest(), b"thr");
    }

    #[test]
    fn a_line_without_end_is_refused_at_the_bound() {
        let mut buffer = LineBuffer::default();

        buffer.push(&[b'x'; crate::device::LINE_BYTES_MAX]);

        assert_eq!(buffer.next_line(), Err(LineError));
    }
}
