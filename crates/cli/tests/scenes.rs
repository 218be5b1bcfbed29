//! Scene files: they say everything that the command line says, and remake pictures bit for bit.

mod common;

use std::collections::BTreeSet;

use common::{Workshop, collection, head, legacy_grid, legacy_vectors, scene_json, text_nrrd, vector};
use serde_json::{Value, json};

fn workshop() -> Workshop {
    let shop = Workshop::new();
    std::fs::create_dir_all(shop.path("data")).expect("a saved scene that is whole");
    std::fs::create_dir_all(shop.path("saved/here")).expect("a saved scene that is whole");
    shop.write_volume("data/head.nrrd", &head());
    shop.write("data/cells.vtk", legacy_grid(1.0, usize::MAX));
    shop.write("flow.vtk", legacy_vectors());
    shop.write("late.vtk", legacy_grid(3.0, usize::MAX));
    shop.write("steps.pvd", collection(&["data/cells.vtk", "late.vtk"]));
    shop.write("vectors.nrrd", text_nrrd("3 6 6 6", "vector domain domain domain", vector));
    shop.write("times.nrrd", text_nrrd("6 6 6 3", "domain domain domain time", |i| vector(i) * vector(i)));
    shop.write("data/samples.bin", (0..=255).cycle().take(12 * 10 * 9 * 2).collect::<Vec<u8>>());
    shop.write("hull.obj", "v 5 5 5\nv 30 5 5\nv 5 30 9\nf 1 2 3\n");
    let mut scene = scene_json("waves.nrrd");
    scene["meshes"] = json!([{"file": "hull.obj", "color": [1, 0, 0]}]);
    shop.write("hull.json", scene.to_string());
    shop.write("t.json", scene_json("x")["transfer_function"].to_string());
    shop.write(
        "edges.json",
        json!({"values": [0, 4], "magnitudes": [0, 2], "columns": 2, "rows": 2, "colors": [[0.9, 0.5, 0.2], [0.1, 0.5, 0.2],
               [0.9, 0.5, 0.9], [1, 1, 1]], "opacities": [0.0, 0.1, 0.6, 0.9], "unit_distance": 1.0})
        .to_string(),
    );
    let pixels: Vec<_> = (0..60).map(|i| [i as f32 / 60.0, 0.5, 1.0 - i as f32 / 60.0]).collect();
    volery::io::write_png(&shop.path("image.png"), 10, 6, &pixels).expect("a saved scene that is whole");
    shop.done("slice data/cells.vtk -o data/cells.vsl --count 20 --axis 0.3,0.5,0.81");
    shop
}

const LINES: [&str; 30] = [
    "waves.nrrd",
    "waves.nrrd --size 31x47 --view 200,-30,1.7",
    "waves.nrrd --orthographic --transfer viridis",
    "waves.nrrd --range 60,180 --background 0.1,0.2,0.3",
    "waves.nrrd --tolerance 0.3 --transfer ramp",
    "waves.nrrd --memory 75KiB --view 15,25",
    "waves.nrrd --memory 90KiB --interest sphere:8,8,8,6,9 --interest box:30,30,30,39,39,39,0.5 --view 60,5",
    "waves.nrrd --technique fans --thickness interpolated --view 30,20,3",
    "waves.nrrd --technique fans --tolerance 0.1",
    "waves.nrrd --technique plane",
    "waves.nrrd --technique plane --plane 0.3,0.5,0.81,20 --plane 1,0,0,12.5 --focus 10,10,10 --quality 0.3",
    "waves.nrrd --technique plane --focus 10,10,10 --quality inf",
    "waves.nrrd --plane 0,0,1,20.25 --nearest --show-nodes",
    "waves.nrrd --plane 1,1,1,50 --error 0.2 --transparent --transfer magma",
    "waves.nrrd --transfer t.json",
    "data/head.nrrd --transfer ct-bone",
    "data/samples.bin --dims 12,10,9 --dtype >u2 --spacing 1,2,0.5",
    "hull.json",
    "hull.json --view 80,10 --transfer plasma --size 20x20",
    "image.png",
    "data/cells.vtk",
    "data/cells.vtk --array heat --slices 30 --adaptive 0.9 --view 10,50",
    "data/cells.vtk --axes --shade --quantized",
    "data/cells.vtk --transfer edges.json",
    "data/cells.vsl",
    "data/cells.vsl --shade --range 0.5,2",
    "vectors.nrrd --channel 1",
    "times.nrrd --volume 2",
    "flow.vtk --array flow --component 2",
    "steps.pvd --time-step 1",
];

#[test]
fn a_saved_scene_remakes_the_picture_bit_for_bit() {
    let shop = workshop();
    let mut pictures = BTreeSet::new();
    for line in LINES {
        let size = if line.contains("--size") { "" } else { "--size 40x30" };
        for saved in ["s.json", "saved/here/s.json"] {
            shop.done(&format!("render {line} {size} --backend software -o a.exr --save-scene {saved}"));
            shop.done(&format!("render {saved} -o b.exr"));
            assert!(shop.bytes("a.exr") == shop.bytes("b.exr"), "{line}: {}", shop.json(saved));
            assert_eq!(schema().defects(&shop.json(saved)), Vec::<String>::new(), "{line}");
            // A scene that was saved says all, so saving it again changes nothing.
            shop.done(&format!(
                "render {saved} -o b.exr --save-scene {}",
                saved.replace("s.json", "t2.json")
            ));
            assert_eq!(shop.json(saved), shop.json(&saved.replace("s.json", "t2.json")), "{line}");
        }
        pictures.insert(shop.bytes("a.exr"));
    }
    // The infinite quality of one line is the full resolution of another.
    assert!(pictures.len() >= LINES.len() - 1, "{} different pictures", pictures.len());
    // A scene moves together with its files.
    shop.done("render waves.nrrd --size 20x20 -o a.exr --save-scene s.json");
    std::fs::create_dir(shop.path("moved")).expect("a saved scene that is whole");
    for name in ["s.json", "waves.nrrd"] {
        std::fs::rename(shop.path(name), shop.path(format!("moved/{name}")))
            .expect("a saved scene that is whole");
    }
    shop.done("render moved/s.json -o b.exr");
    assert!(shop.bytes("a.exr") == shop.bytes("b.exr"));
}

#[test]
fn a_scene_needs_its_input_alone() {
    let shop = workshop();
    shop.write("least.json", r#"{"input": {"file": "waves.nrrd"}}"#);
    shop.done("render least.json -o a.png --size 40x30");
    shop.done("render waves.nrrd -o b.png --size 40x30");
    assert!(shop.bytes("a.png") == shop.bytes("b.png"));
    shop.write("cells.json", r#"{"input": {"file": "data/cells.vtk"}, "slices": 20, "size": [30, 30]}"#);
    shop.done("render cells.json -o a.png --report r.json");
    assert_eq!(shop.json("r.json")["work"]["slices"], 20);
    shop.write("both.json", r#"{"input": {"file": "waves.nrrd"}, "slices": 20, "nearest": true}"#);
    shop.run_line("render both.json -o c.png").fails(1, &["both.json", "slices", "nearest"]);
    shop.write(
        "rays.json",
        r#"{"input": {"file": "waves.nrrd"}, "technique": "raycast", "show_nodes": true}"#,
    );
    shop.run_line("render rays.json -o c.png").fails(1, &["rays.json", "show_nodes is read by"]);
    assert!(!shop.names().contains(&"c.png".to_owned()));
}

#[test]
fn the_report_says_what_was_drawn_of_what() {
    let shop = workshop();
    shop.done("render hull.json -o a.png --report r.json --save-scene s.json");
    let (report, scene) = (shop.json("r.json"), shop.json("s.json"));
    assert_eq!(report["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(
        (&report["camera"], &report["transfer_function"]),
        (&scene["camera"], &scene["transfer_function"])
    );
    let files: Vec<_> = report["inputs"]
        .as_array()
        .expect("a saved scene that is whole")
        .iter()
        .map(|file| {
            let path = file["path"].as_str().expect("a saved scene that is whole");
            assert_eq!(file["bytes"].as_u64(), Some(shop.bytes(path).len() as u64), "{path}");
            path
        })
        .collect();
    assert_eq!(files, ["hull.json", "hull.obj", "waves.nrrd"]);
    shop.done("render image.png -o b.png --report r.json");
    assert_eq!(shop.json("r.json").get("transfer_function"), None);
}

/// The part of JSON Schema that ours is written in.
struct Schema(Value);

fn schema() -> Schema {
    let text = include_str!("../../../docs/scene.schema.json");
    Schema(serde_json::from_str(text).expect("a keyword as schemas have it"))
}

impl Schema {
    fn defects(&self, value: &Value) -> Vec<String> {
        let mut defects = Vec::new();
        self.check(&self.0, value, "scene", &mut defects);
        defects
    }

    fn check(&self, schema: &Value, value: &Value, place: &str, defects: &mut Vec<String>) {
        for (keyword, rule) in schema.as_object().expect("a keyword as schemas have it") {
            let number = || rule.as_f64().expect("a keyword as schemas have it");
            let is_right = match keyword.as_str() {
                "$schema" | "$defs" | "title" | "description" | "examples" | "default" => true,
                "$ref" => {
                    let target = rule
                        .as_str()
                        .expect("a keyword as schemas have it")
                        .strip_prefix('#')
                        .expect("a keyword as schemas have it");
                    self.check(
                        self.0.pointer(target).expect("a keyword as schemas have it"),
                        value,
                        place,
                        defects,
                    );
                    true
                }
                "type" => match rule.as_str().expect("a keyword as schemas have it") {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "number" => value.is_number(),
                    "integer" => value.as_f64().is_some_and(|x| x.fract() == 0.0),
                    "boolean" => value.is_boolean(),
                    other => panic!("type {other}"),
                },
                "enum" => rule.as_array().expect("a keyword as schemas have it").contains(value),
                "minimum" => value.as_f64().is_none_or(|x| x >= number()),
                "maximum" => value.as_f64().is_none_or(|x| x <= number()),
                "exclusiveMinimum" => value.as_f64().is_none_or(|x| x > number()),
                "exclusiveMaximum" => value.as_f64().is_none_or(|x| x < number()),
                "minItems" => value.as_array().is_none_or(|list| list.len() as f64 >= number()),
                "maxItems" => value.as_array().is_none_or(|list| list.len() as f64 <= number()),
                "required" => {
                    let has = |name: &Value| {
                        value.get(name.as_str().expect("a keyword as schemas have it")).is_some()
                    };
                    rule.as_array().expect("a keyword as schemas have it").iter().all(has)
                }
                "items" => {
                    for item in value.as_array().into_iter().flatten() {
                        self.check(rule, item, &format!("{place}[]"), defects);
                    }
                    true
                }
                "properties" => {
                    for (name, rule) in rule.as_object().expect("a keyword as schemas have it") {
                        if let Some(value) = value.get(name) {
                            self.check(rule, value, &format!("{place}.{name}"), defects);
                        }
                    }
                    true
                }
                "additionalProperties" => {
                    assert_eq!(*rule, Value::Bool(false));
                    let known = &schema["properties"];
                    value.as_object().is_none_or(|fields| fields.keys().all(|name| known.get(name).is_some()))
                }
                "oneOf" => {
                    let fits = |rule: &&Value| {
                        let mut defects = Vec::new();
                        self.check(rule, value, place, &mut defects);
                        defects.is_empty()
                    };
                    rule.as_array().expect("a keyword as schemas have it").iter().filter(fits).count() == 1
                }
                other => panic!("the schema has a keyword that this test does not know: {other}"),
            };
            if !is_right {
                defects.push(format!("{place}: {keyword} {rule}"));
            }
        }
    }
}

#[test]
fn the_schema_and_the_parser_agree() {
    let schema = schema();
    let parse = |value: &Value| volery::io::SceneFile::parse(&value.to_string());
    let examples = schema.0["examples"].as_array().expect("a keyword as schemas have it");
    assert!(examples.len() >= 2);
    let file: Value = serde_json::from_str(include_str!("../../../docs/scene.example.json"))
        .expect("a keyword as schemas have it");
    for example in examples.iter().chain([&file]) {
        assert_eq!(schema.defects(example), Vec::<String>::new());
        parse(example).expect("a keyword as schemas have it");
    }
    // Every field in one of the examples, and each with a wrong value refused by both.
    let fields: BTreeSet<&String> =
        schema.0["properties"].as_object().expect("a keyword as schemas have it").keys().collect();
    let shown: BTreeSet<&String> = examples
        .iter()
        .chain([&file])
        .flat_map(|example| example.as_object().expect("a keyword as schemas have it").keys())
        .collect();
    assert_eq!(fields, shown);
    let wrong =
        [json!(-3), json!([]), json!({"x": 1}), json!([1, 2, 3, 4, 5]), json!([-1, 2]), json!([2, 1, -5])];
    let mut num_wrong = 0;
    for field in &fields {
        for value in wrong.iter().chain([&json!("such"), &json!(true), &json!(7.5)]) {
            let mut scene = json!({"input": {"file": "a.nrrd"}});
            scene[field.as_str()] = value.clone();
            let (by_schema, by_parser) = (schema.defects(&scene), parse(&scene));
            // That ranges rise and normals have a length is more than a schema can say.
            let is_more = matches!(field.as_str(), "range") && by_schema.is_empty();
            assert!(
                by_schema.is_empty() == by_parser.is_ok() || is_more,
                "{scene}: {by_schema:?} {by_parser:?}"
            );
            num_wrong += usize::from(by_parser.is_err());
        }
    }
    assert!(num_wrong > 100, "{num_wrong}");
    // The parser knows the fields of the schema and no others, and says which.
    let unknown = parse(&json!({"input": {"file": "a"}, "colour": 1})).unwrap_err().to_string();
    let known: BTreeSet<String> = unknown.split('`').skip(3).step_by(2).map(str::to_owned).collect();
    assert_eq!(known.iter().collect::<BTreeSet<_>>(), fields);
    let unknown = parse(&json!({"input": {"file": "a", "size": 1}})).unwrap_err().to_string();
    let known: BTreeSet<String> = unknown.split('`').skip(3).step_by(2).map(str::to_owned).collect();
    let of_input: BTreeSet<&String> = schema.0["properties"]["input"]["properties"]
        .as_object()
        .expect("a keyword as schemas have it")
        .keys()
        .collect();
    assert_eq!(known.iter().collect::<BTreeSet<_>>(), of_input);
}
