//! Volume visualisation at the resolution that a picture, a deadline or a memory budget needs.
