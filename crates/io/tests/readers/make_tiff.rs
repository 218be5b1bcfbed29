//! TIFF files made by hand: any tags, strips or tiles, both byte orders, TIFF and BigTIFF.

use volery_io::ByteOrder::{self, Big, Little};

/// A tag: its number, kind and values, the bytes of which are those of one number each.
#[derive(Clone)]
pub(crate) struct Tag(u16, u16, Vec<u64>);

pub(crate) fn short(tag: u16, values: &[u64]) -> Tag {
    Tag(tag, 3, values.to_vec())
}

pub(crate) fn long(tag: u16, values: &[u64]) -> Tag {
    Tag(tag, 4, values.to_vec())
}

/// A ratio of two whole numbers.
pub(crate) fn ratio(tag: u16, above: u64, below: u64) -> Tag {
    Tag(tag, 5, vec![above, below])
}

pub(crate) fn text(tag: u16, text: &str) -> Tag {
    Tag(tag, 2, text.bytes().chain([0]).map(u64::from).collect())
}

/// A page: its tags but for those that say where data are, and its strips or tiles.
#[derive(Clone)]
pub(crate) struct Page {
    pub(crate) tags: Vec<Tag>,
    pub(crate) chunks: Vec<Vec<u8>>,
    pub(crate) is_tiled: bool,
}

impl Page {
    /// One strip of gray of so many bits.
    pub(crate) fn gray(width: u64, height: u64, bits: u64, data: Vec<u8>) -> Self {
        let tags = vec![
            long(256, &[width]),
            long(257, &[height]),
            short(258, &[bits]),
            short(259, &[1]),
            short(262, &[1]),
            short(277, &[1]),
            long(278, &[height]),
        ];
        Self { tags, chunks: vec![data], is_tiled: false }
    }

    /// The same page with other values of these tags.
    pub(crate) fn with(mut self, tags: &[Tag]) -> Self {
        self.tags.retain(|own| tags.iter().all(|tag| tag.0 != own.0));
        self.tags.extend_from_slice(tags);
        self
    }
}

/// A file of pages, one after the other, and bytes behind the data of the last one.
pub(crate) fn file(order: ByteOrder, is_big: bool, pages: &[Page], behind: &[u8]) -> Vec<u8> {
    let number = |value: u64, width: usize| {
        let mut bytes = value.to_le_bytes()[..width].to_vec();
        if order == Big {
            bytes.reverse();
        }
        bytes
    };
    let place = if is_big { 8 } else { 4 };
    let mut file = if order == Little { b"II".to_vec() } else { b"MM".to_vec() };
    if is_big {
        file.extend([number(43, 2), number(8, 2), number(0, 2)].concat());
    } else {
        file.extend(number(42, 2));
    }
    let mut link = file.len();
    file.extend(number(0, place));
    for (index, page) in pages.iter().enumerate() {
        let (mut offsets, mut counts) = (Vec::new(), Vec::new());
        let mut tags = page.tags.clone();
        let tags_bytes: usize = tags.iter().map(|tag| 32 + 8 * tag.2.len()).sum();
        // Data of the last page lie at the end, so that more can follow.
        let ahead = if index + 1 == pages.len() { tags_bytes + 32 * page.chunks.len() + 256 } else { 0 };
        let mut data = file.len() + ahead;
        for chunk in &page.chunks {
            offsets.push(data as u64);
            counts.push(chunk.len() as u64);
            data += chunk.len();
        }
        if ahead == 0 {
            file.extend(page.chunks.concat());
        }
        let [offsets_tag, counts_tag] = if page.is_tiled { [324, 325] } else { [273, 279] };
        tags.push(long(offsets_tag, &offsets));
        tags.push(long(counts_tag, &counts));
        tags.sort_by_key(|tag| tag.0);
        let mut values = Vec::new();
        let directory = file.len().next_multiple_of(2);
        file.resize(directory, 0);
        let [count_bytes, entry_bytes] = if is_big { [8, 20] } else { [2, 12] };
        let first_value = directory + count_bytes + entry_bytes * tags.len() + place;
        file[link..link + place].copy_from_slice(&number(directory as u64, place));
        file.extend(number(tags.len() as u64, count_bytes));
        for Tag(tag, kind, list) in &tags {
            let width = [0, 1, 1, 2, 4, 4][*kind as usize];
            let bytes: Vec<u8> = list.iter().flat_map(|&value| number(value, width)).collect();
            let count = if *kind == 5 { list.len() / 2 } else { list.len() };
            file.extend(
                [number((*tag).into(), 2), number((*kind).into(), 2), number(count as u64, place)].concat(),
            );
            if bytes.len() <= place {
                file.extend(&bytes);
                file.resize(file.len() + place - bytes.len(), 0);
            } else {
                file.extend(number((first_value + values.len()) as u64, place));
                values.extend(bytes);
            }
        }
        link = file.len();
        file.extend(number(0, place));
        file.extend(values);
        if ahead > 0 {
            let start = offsets.first().map_or(file.len(), |&start| start as usize);
            assert!(file.len() <= start, "{} of {start}", file.len());
            file.resize(start, 0);
            file.extend(page.chunks.concat());
        }
    }
    file.extend(behind);
    file
}

/// A little-endian file.
pub(crate) fn little(pages: &[Page]) -> Vec<u8> {
    file(Little, false, pages, b"")
}

/// Pages of 2 x 1 bytes: the first has 0 and 1, the next 10 and 11.
pub(crate) fn numbered(count: u64) -> Vec<Page> {
    (0..count).map(|page| Page::gray(2, 1, 8, vec![(10 * page) as u8, (10 * page + 1) as u8])).collect()
}
