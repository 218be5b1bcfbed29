// Directions.

// Of length 1 also where lengths have no square in 32 bits; none stays none.
fn unit(v: vec3f) -> vec3f {
    let longest = max(max(abs(v.x), abs(v.y)), abs(v.z));
    if !(longest > 0.0) {
        return vec3f(0.0);
    }
    return normalize(v / longest);
}
