//! Sessions, as far as they are alike.

use volery::glam::DVec3;
use volery::{GridSession, Preset, Session, StackSession, TransferFunction, View, ViewOptions};

pub(crate) trait Drawn {
    fn view(&self, options: &ViewOptions) -> View;
    fn preset(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction;
    fn value_range(&self) -> [f64; 2];
    fn extent(&self) -> DVec3;
    /// Whether values may be classified together with the magnitude of their gradient.
    fn knows_gradients(&self) -> bool;
    /// Whether samples are colours, which no transfer function changes.
    fn has_colors(&self) -> bool;
}

macro_rules! drawn {
    ($session:ty, $knows_gradients:literal, $has_colors:expr) => {
        impl Drawn for $session {
            fn view(&self, options: &ViewOptions) -> View {
                <$session>::view(self, options)
            }

            fn preset(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
                <$session>::preset_over(self, preset, range)
            }

            fn value_range(&self) -> [f64; 2] {
                <$session>::value_range(self)
            }

            fn extent(&self) -> DVec3 {
                <$session>::extent(self)
            }

            fn knows_gradients(&self) -> bool {
                $knows_gradients
            }

            fn has_colors(&self) -> bool {
                #[allow(clippy::redundant_closure_call, reason = "of two of the three it is a constant")]
                ($has_colors)(self)
            }
        }
    };
}

drawn!(Session, false, |session: &Session| session.grid().sample_type().channels() > 1);
drawn!(GridSession, true, |_| false);
drawn!(StackSession, true, |_| false);
