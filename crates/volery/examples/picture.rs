//! A file to a picture: `picture VOLUME OUT.png`.

use std::error::Error;
use std::path::Path;

use volery::{BackendChoice, Session, ViewOptions, open_backend, output, read_input};

fn main() -> Result<(), Box<dyn Error>> {
    let [file, out] = [1, 2].map(|i| std::env::args_os().nth(i).unwrap_or_default());
    let mut session = Session::new(read_input(Path::new(&file), None)?.volume_data()?);
    let view = session.view(&ViewOptions::default());
    let picture = session.render(&view, open_backend(BackendChoice::Auto)?.as_mut())?;
    Ok(output::write_image(Path::new(&out), &picture.image)?)
}
