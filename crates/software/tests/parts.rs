//! A picture in parts has the bits of the whole one.

use volery_conformance::pictures_in_parts_are_the_same;
use volery_frame::{Backend, DrawError, Drawn, Frame, Image};
use volery_software::SoftwareBackend;

/// Keeps the pictures: each whole one, then what was made of it in parts.
struct Keeping {
    backend: SoftwareBackend,
    groups: Vec<Vec<Image>>,
}

impl Backend for Keeping {
    volery_conformance::hand_on!(self, self.backend => device set_volume volume is_resident upload evict resident_bytes brick_bytes room reserve
        uploaded_bytes begin begin_windows draw_windows wait draw_part finished);

    fn finish(&mut self) -> Result<Drawn, DrawError> {
        let drawn = self.backend.finish()?;
        self.groups.last_mut().expect("whole pictures come first").push(drawn.image.clone());
        Ok(drawn)
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        let drawn = self.backend.draw(frame)?;
        self.groups.push(vec![drawn.image.clone()]);
        Ok(drawn)
    }
}

#[test]
fn a_picture_in_parts_has_the_bits_of_the_whole() {
    let mut keeping = Keeping { backend: SoftwareBackend::new(), groups: Vec::new() };
    pictures_in_parts_are_the_same(&mut keeping);
    let bits = |image: &Image| image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>();
    let mut num_compared = 0;
    for (number, group) in keeping.groups.iter().enumerate() {
        for in_parts in &group[1..] {
            assert!(bits(in_parts) == bits(&group[0]), "picture {number} in parts differs in bits");
            num_compared += 1;
        }
    }
    println!("{num_compared} pictures in parts");
    assert!(num_compared >= 60, "{num_compared} pictures in parts, expected at least 60");
}
