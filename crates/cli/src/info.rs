//! `volery info`

use volery::{GridInfo, Info, read_input};

use crate::args::InfoArgs;
use crate::progress::Progress;
use crate::{Failure, say};

pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let busy = Progress::spinner("reading");
    let text = if volery::io::is_grid(&args.input) {
        let info = GridInfo::read(&args.input)?;
        if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() }
    } else {
        let info = Info::of(&read_input(&args.input, args.data.as_deref())?.volume);
        if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() }
    };
    drop(busy);
    say(text.trim_end())
}
