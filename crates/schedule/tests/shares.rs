//! Shares of time by importance, beside tables 3 to 6 of Li and Shen (2001): the important third gains at least as much.

use volery_schedule::importance::{gaze, max_opacity, nearness, normalise, projected_area, weighted_sum};
use volery_schedule::simulate::{Scene, play};
use volery_schedule::{Order, Scheduler, Settings};

fn shares(class_importance: [f64; 3], order: Order) -> [f64; 3] {
    let mut scene = Scene { num_frames: 1000, ..Scene::default() };
    scene.world.class_importance = class_importance;
    // Which third an item belongs to must not turn, and without importance no third is to cost more.
    (scene.world.turning, scene.world.num_items) = (0.0, 150);
    let settings = Settings { order, ..Settings::default() };
    let outcome = play(&scene, &mut Scheduler::new(settings));
    assert!(outcome.distribution().within_5_percent >= 0.99);
    outcome.class_shares()
}

#[test]
fn the_important_third_gains_as_much_as_in_the_paper() {
    // The middles of three classes of opacity; of boxes at distances of 1.25, 2.25 and 3.25, by nearness and area in equal
    // parts; and of places at 1/8, 3/8 and 5/8 of the screen from the gaze, radius 1/10.
    let opacity = [0.15, 0.5, 0.9].map(|opacity| max_opacity([0.05, opacity]));
    let distances = [3.25_f64, 2.25, 1.25];
    let mut near = distances.map(|distance| nearness([0.0; 3], [0.0, 0.0, distance], 0.1));
    let mut area = distances.map(|distance| {
        let half = 1.0 / distance;
        projected_area([[-half, -half], [half, half]], [[-2.0, -2.0], [2.0, 2.0]])
    });
    normalise(&mut near);
    normalise(&mut area);
    let near_and_large = [0, 1, 2].map(|class| weighted_sum([(0.5, near[class]), (0.5, area[class])]));
    let gazes = [5.0, 3.0, 1.0].map(|eighths| gaze([0.0, 0.0], [eighths / 8.0, 0.0], 0.1));
    let tables = [
        ("3, opacity", opacity, 0.4768 - 0.3232),
        ("4, distance and area", near_and_large, 0.4959 - 0.3229),
        ("5, gaze, delta wing", gazes, 0.6339 - 0.2735),
        ("6, gaze, brain", gazes, 0.6626 - 0.4632),
    ];
    for order in [Order::Kept, Order::LargestFirst] {
        let without = shares([1.0; 3], order);
        for (name, importance, paper) in tables {
            let with = shares(importance, order);
            let gain = with[2] - without[2];
            println!(
                "{order:?}, table {name}: importance {importance:.3?}, without {without:.3?}, with {with:.3?}: the important third gains {:.1} \
                 points, expected at least {:.1}",
                100.0 * gain,
                100.0 * paper
            );
            assert!(gain >= paper && with[0] < without[0]);
        }
    }
}
