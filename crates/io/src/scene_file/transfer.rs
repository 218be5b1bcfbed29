//! Transfer functions in scenes: points, a table over values and magnitudes, or the name of a preset.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::SceneTransfer;
use crate::transfer::{Transfer2dJson, TransferJson};

/// Serialises a transfer function as scene files have it.
///
/// # Errors
/// Those of the serialiser.
pub fn serialize<S: Serializer>(transfer: &Option<SceneTransfer>, serializer: S) -> Result<S::Ok, S::Error> {
    match transfer {
        None => serializer.serialize_none(),
        Some(SceneTransfer::Values(function)) => TransferJson::new(function).serialize(serializer),
        Some(SceneTransfer::Magnitudes(function)) => Transfer2dJson::new(function).serialize(serializer),
        Some(SceneTransfer::Preset(name)) => name.serialize(serializer),
    }
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<SceneTransfer>, D::Error> {
    let in_field =
        |problem: &dyn std::fmt::Display| D::Error::custom(format!("transfer_function: {problem}"));
    Ok(Some(match Value::deserialize(deserializer)? {
        Value::Null => return Ok(None),
        Value::String(name) => SceneTransfer::Preset(name),
        value if value.get("magnitudes").is_some() => {
            let json = Transfer2dJson::deserialize(value).map_err(|error| in_field(&error))?;
            SceneTransfer::Magnitudes(json.validated().map_err(D::Error::custom)?)
        }
        value => {
            let json = TransferJson::deserialize(value).map_err(|error| in_field(&error))?;
            SceneTransfer::Values(json.validated().map_err(D::Error::custom)?)
        }
    }))
}
