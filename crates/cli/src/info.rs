//! `volery info`

use volery::{GridInfo, Info, InputData, InputOptions, StackInfo};

use crate::args::InfoArgs;
use crate::progress::Progress;
use crate::{Failure, say};

pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let busy = Progress::spinner("reading");
    let options = InputOptions { data_dir: args.data.clone(), input: args.file.of_scene() };
    let plan = options.find(&args.input)?;
    let input = plan.read()?;
    let text = match input.data {
        InputData::Grid(file) => {
            let info = GridInfo::of(&input.path, file, &plan.input.grid_options())?;
            if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() }
        }
        InputData::Stack(mesh) => {
            let info = StackInfo::of(&mesh);
            if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() }
        }
        InputData::Volume(volume) => {
            let info = Info::of(&volume);
            if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() }
        }
    };
    drop(busy);
    say(text.trim_end())
}
