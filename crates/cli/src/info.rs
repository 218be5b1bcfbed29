//! `volery info`

use volery::{Info, read_input};

use crate::args::InfoArgs;
use crate::progress::Progress;
use crate::{Failure, say};

pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let info = {
        let _busy = Progress::spinner("reading");
        Info::of(&read_input(&args.input, args.data.as_deref())?.volume)
    };
    let text = if args.json { serde_json::to_string_pretty(&info)? } else { info.to_string() };
    say(text.trim_end())
}
