//! HDF5's byte shuffle.

/// Bytes in the order of HDF5's filter: first bytes of all elements, then second bytes,
/// and so on. Bytes after the last whole element stay at the end.
pub(super) fn shuffle(bytes: &[u8], element: usize, out: &mut Vec<u8>) {
    let count = bytes.len() / element;
    // Every byte is overwritten below, so it need not be cleared.
    out.resize(bytes.len(), 0);
    let (elements, rest) = bytes.split_at(count * element);
    let (planes, end) = out.split_at_mut(elements.len());
    end.copy_from_slice(rest);
    // Element sizes of images are processed in registers, sixteen elements at a time.
    let done = match element {
        2 => blocks_of_two(elements, planes),
        4 => blocks_of_four(elements, planes),
        _ => 0,
    };
    for (k, plane) in planes.chunks_exact_mut(count.max(1)).enumerate() {
        let elements = elements.chunks_exact(element).skip(done);
        for (to, from) in plane[done..].iter_mut().zip(elements) {
            *to = from[k];
        }
    }
}

/// Elements of one block.
const BLOCK: usize = 16;

/// Shuffles whole blocks of 16-bit elements; returns the number of these elements.
fn blocks_of_two(elements: &[u8], planes: &mut [u8]) -> usize {
    let (elements, _) = elements.as_chunks::<2>();
    let (low, high) = planes.split_at_mut(elements.len());
    let (blocks, _) = elements.as_chunks::<BLOCK>();
    let low = low.as_chunks_mut::<BLOCK>().0;
    let high = high.as_chunks_mut::<BLOCK>().0;
    for ((block, low), high) in blocks.iter().zip(low).zip(high) {
        let values = block.map(u16::from_le_bytes);
        *low = values.map(|value| value as u8);
        *high = values.map(|value| (value >> 8) as u8);
    }
    blocks.len() * BLOCK
}

/// Shuffles whole blocks of 32-bit elements; returns the number of these elements.
fn blocks_of_four(elements: &[u8], planes: &mut [u8]) -> usize {
    let (elements, _) = elements.as_chunks::<4>();
    let (low, high) = planes.split_at_mut(2 * elements.len());
    let (first, second) = low.split_at_mut(elements.len());
    let (third, fourth) = high.split_at_mut(elements.len());
    let (blocks, _) = elements.as_chunks::<BLOCK>();
    let [first, second, third, fourth] =
        [first, second, third, fourth].map(|plane| plane.as_chunks_mut::<BLOCK>().0);
    let low = first.iter_mut().zip(second);
    let high = third.iter_mut().zip(fourth);
    for ((block, (first, second)), (third, fourth)) in blocks.iter().zip(low).zip(high) {
        let values = block.map(u32::from_le_bytes);
        *first = values.map(|value| value as u8);
        *second = values.map(|value| (value >> 8) as u8);
        *third = values.map(|value| (value >> 16) as u8);
        *fourth = values.map(|value| (value >> 24) as u8);
    }
    blocks.len() * BLOCK
}

/// Undoes [`shuffle`].
pub(super) fn unshuffle(bytes: &[u8], element: usize) -> Vec<u8> {
    let mut out = vec![0; bytes.len()];
    match element {
        2 => gather::<2>(bytes, &mut out),
        4 => gather::<4>(bytes, &mut out),
        8 => gather::<8>(bytes, &mut out),
        _ => {
            let count = bytes.len() / element.max(1);
            for (k, plane) in bytes.chunks_exact(count.max(1)).take(element).enumerate() {
                for (to, &from) in out.chunks_exact_mut(element).zip(plane) {
                    to[k] = from;
                }
            }
        }
    }
    out
}

fn gather<const N: usize>(bytes: &[u8], out: &mut [u8]) {
    let count = bytes.len() / N;
    let planes: [&[u8]; N] = std::array::from_fn(|k| &bytes[k * count..(k + 1) * count]);
    for (i, to) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
        *to = std::array::from_fn(|k| planes[k][i]);
    }
}
