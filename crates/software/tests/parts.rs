//! A picture in parts has the bits of the whole one.

use volery_conformance::pictures_in_parts_are_the_same;
use volery_frame::{
    Backend, Brick, BrickId, Content, Device, DrawError, Drawn, FinishedPart, Frame, Image, PictureView,
    Revision, UploadError, UploadedBytes, VolumeLayout,
};
use volery_software::SoftwareBackend;

/// Keeps the pictures: each whole one, then what was made of it in parts.
struct Keeping {
    backend: SoftwareBackend,
    groups: Vec<Vec<Image>>,
}

impl Backend for Keeping {
    fn device(&self) -> Device {
        self.backend.device()
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        self.backend.set_volume(layout)
    }

    fn volume(&self) -> Option<Revision> {
        self.backend.volume()
    }

    fn is_resident(&self, id: BrickId) -> bool {
        self.backend.is_resident(id)
    }

    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        self.backend.upload(bricks)
    }

    fn evict(&mut self, bricks: &[BrickId]) {
        self.backend.evict(bricks);
    }

    fn resident_bytes(&self) -> u64 {
        self.backend.resident_bytes()
    }

    fn uploaded_bytes(&self) -> UploadedBytes {
        self.backend.uploaded_bytes()
    }

    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError> {
        self.backend.begin(view)
    }

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        self.backend.draw_part(content)
    }

    fn finished(&mut self) -> Vec<FinishedPart> {
        self.backend.finished()
    }

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
