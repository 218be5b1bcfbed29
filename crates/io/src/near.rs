//! What somebody may have meant.

/// Names as near as this are offered (Jaro and Winkler's similarity).
const LEAST_SIMILARITY: f64 = 0.8;

/// The known name that is most like one that is not known; `None` where none is like it.
pub fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let name = name.to_lowercase();
    let similarity = |known: &&str| strsim::jaro_winkler(&name, &known.to_lowercase());
    let best = known.iter().copied().max_by(|a, b| similarity(a).total_cmp(&similarity(b)))?;
    (similarity(&best) >= LEAST_SIMILARITY).then_some(best)
}

/// All known names in one text, and the one that may have been meant.
pub fn one_of(name: &str, known: &[&str]) -> String {
    let near = nearest(name, known).map(|near| format!("; did you mean {near}?"));
    format!("{}{}", known.join(", "), near.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_of_the_pen_are_understood_and_others_are_not() {
        let known = ["viridis", "inferno", "plasma", "cool-to-warm"];
        for (name, meant) in [
            ("virids", Some("viridis")),
            ("Viridis", Some("viridis")),
            ("cooltowarm", Some("cool-to-warm")),
            ("xyz", None),
            ("", None),
        ] {
            assert_eq!(nearest(name, &known), meant, "{name}");
        }
        assert_eq!(nearest("viridis", &[]), None);
        assert_eq!(one_of("virids", &known[..2]), "viridis, inferno; did you mean viridis?");
    }
}
