//! The suite that every backend passes: one function per property, each panics with what it measured.
//!
//! # Method
//! Pictures are compared with closed forms where there are any, else with a slow march in f64 through the
//! field that the bricks were cut from (`oracle::march`), midpoint rule, many steps per cell. The
//! marcher shares nothing with a backend but the camera's rays and the transfer function. Cutting planes are
//! compared with a search through all bricks for every pixel (`plane_oracle`); where that picture jumps within a
//! few thousandths of a pixel either side is right, and such pixels are counted. Cubes are compared with their chords,
//! sheets with every ray against every triangle (`sheet_oracle`), and so are opaque surfaces.
//! Every check prints its threshold beside the value that it measured.
//!
//! # What a backend may do
//! - Stop a ray once it lets through less than [`STOP_TRANSMITTANCE`] of the light; thresholds allow for it.
//! - Round values to the bins of the frame's [`RayTransfer`](volery_frame::RayTransfer).
//! - Nothing else: no sampling distance, no guard distance at the faces of bricks or of the volume.
//!
//! # Use
//! ```text
//! volery_conformance::conformance_tests!(MyBackend::new());
//! ```
//! makes a `#[test]` of each property, each with a fresh backend; [`ALL`] lists them for other runners.

#![allow(clippy::missing_panics_doc, reason = "every property panics where it does not hold")]

mod compositing;
mod cubes;
mod hand_on;
mod levels;
mod matter;
mod mirror;
mod oracle;
mod order;
mod outlines;
mod parts;
mod plane_oracle;
mod planes;
mod requests;
mod sampling;
mod seams;
mod sheet_oracle;
mod sheets;
mod surfaces;
mod views;
mod windows;
mod world;

use volery_frame::Backend;

/// A ray that lets through less than this may stop.
pub const STOP_TRANSMITTANCE: f64 = 1.0 / 4096.0;

/// A property: its name and its check.
pub type Property = (&'static str, fn(&mut dyn Backend));

/// Lists the properties once: as functions, as a table, and as a macro that makes tests of them.
macro_rules! properties {
    ($d:tt $($module:ident: $($name:ident)+;)+) => {
        $(pub use $module::{$($name),+};)+

        /// Every property.
        pub const ALL: &[Property] = &[$($((stringify!($name), $name),)+)+];

        /// Makes a `#[test]` of each property of the conformance suite. The argument is an expression that
        /// makes a backend.
        #[macro_export]
        macro_rules! conformance_tests {
            ($d backend:expr) => {
                $($(
                    #[test]
                    fn $name() {
                        $d crate::$name(&mut $d backend);
                    }
                )+)+
            };
        }
    };
}

properties! { $
    matter:
        uniform_cube_in_perspective
        uniform_cube_orthographic
        linear_ramp_is_the_closed_form
        a_bent_field_has_its_mean
        values_at_a_weak_step_are_above_it
        color_ramp_matches_the_march
        no_extinction_shows_the_background
        extinction_of_1e_minus_30_changes_nothing
        nearly_opaque_matter
        opaque_matter_hides_what_is_behind
        opaque_step_stands_at_its_value
        thin_shell_is_not_missed
        opaque_bands_beside_padding_are_passed
        thin_matter_above_opaque_values
        dense_cells_show_their_front;
    views:
        eye_inside
        eye_on_the_corner_of_bricks
        eye_on_the_face_of_a_brick
        eye_on_a_corner_of_the_volume
        axis_aligned_views_on_sample_planes
        eye_a_million_cells_away
        camera_looking_away_sees_the_background
        volume_behind_the_orthographic_plane
        smooth_field_in_perspective;
    mirror:
        mirrored_cameras_exchange_left_and_right;
    sampling:
        tiny_spacing
        huge_spacing
        anisotropic_spacing
        dims_that_bricks_do_not_divide
        axes_of_two_samples
        axes_of_one_sample_show_nothing
        texel_types_agree
        scale_and_offset_of_values
        range_of_negative_values
        constant_volume
        blank_samples_clear_the_cells_that_touch_them
        volume_of_blanks_shows_the_background
        small_bricks_and_large_ones_agree
        bricks_of_many_cells;
    seams:
        levels_join_without_seams
        levels_do_not_jump;
    levels:
        ramp_is_the_same_in_mixed_levels
        coarse_bricks_end_with_the_domain
        coarse_levels_draw_what_they_hold
        absent_bricks_are_empty
        short_bricks_leave_their_rest_empty;
    compositing:
        thousands_of_thin_layers
        dense_matter_stops_rays_unseen
        background_shines_through;
    order:
        error_falls_with_the_square_of_the_cell;
    requests:
        pictures_of_every_size
        picture_sizes_out_of_range_are_refused
        the_same_frame_gives_the_same_bits
        order_of_uploads_does_not_matter
        transfer_functions_can_change_between_frames
        a_frame_without_bricks_is_background
        drawing_needs_a_volume
        upload_needs_a_volume
        missing_bricks_are_named
        misplaced_bricks_are_named
        bricks_that_do_not_fit_are_refused_and_change_nothing
        bricks_of_the_same_name_are_replaced
        a_new_volume_forgets_bricks
        resident_bytes_count_the_texels
        reserved_bytes_are_kept
        many_uploads_one_by_one;
    planes:
        planes_show_the_trilinear_field
        a_ramp_is_linear_on_planes_of_any_cut
        bricks_blend_by_their_corners
        low_samples_are_the_parents
        nearest_samples
        transparent_planes_cross
        steps_of_the_transfer_function
        values_at_a_step_are_past_it
        blank_cells_show_what_is_behind
        colors_show_themselves
        images_are_volumes_of_one_layer
        outlines_of_bricks
        planes_in_faces_are_seen_once
        planes_that_are_not_seen
        planes_of_far_eyes_and_odd_cells
        absent_and_short_bricks_show_what_is_behind
        few_bricks_in_a_large_volume
        planes_and_rays_in_turn
        wrong_frames_of_planes_are_named;
    cubes:
        one_cube_is_its_chords
        cubes_around_the_eye
        cubes_out_of_sight
        cubes_of_all_extinctions
        fields_of_cubes_are_their_integrals
        cubes_of_all_spacings
        interpolated_lengths_of_parallel_rays_are_exact
        interpolated_lengths_are_linear_on_the_screen
        rays_in_shared_faces_count_once;
    sheets:
        a_constant_sheet_is_a_slab
        linear_values_are_linear_in_space
        triangles_share_sides_without_gap_or_overlap
        stacks_are_their_sums
        thousands_of_thin_sheets
        strips_add_and_take_away
        negative_thickness_is_bounded
        colours_stay_within_what_is_emitted
        sheets_of_all_extinctions
        eyes_inside_stacks
        far_eyes_and_far_origins
        magnitudes_choose_rows
        light_falls_on_both_sides
        quantized_vertices_are_what_their_numbers_say
        sheets_that_show_nothing
        wrong_sheets_are_named
        revisions_name_contents
        sheets_and_rays_in_turn;
    outlines:
        outlines_serve_any_eye;
    surfaces:
        surfaces_end_rays
        surfaces_among_planes
        surfaces_cut_cubes
        surfaces_cut_sheets
        surfaces_around_the_eye
        balls_have_their_outline
        surfaces_have_no_gaps
        the_first_of_equal_surfaces_shows
        no_surface_changes_nothing
        surfaces_seen_from_afar
        a_hundred_thousand_triangles;
    parts:
        pictures_in_parts_are_the_same
        parts_of_several_kinds_make_one_picture
        evicted_bricks_leave_room_for_others
        nothing_that_was_kept_is_stale
        cameras_that_move_upload_nothing
        finished_parts_are_told_once
        parts_can_be_waited_for
        times_of_parts_add_up
        pictures_are_begun_and_ended;
    windows:
        windows_show_their_content_alone
        strides_show_some_rays_of_the_picture
        windows_that_are_none_are_refused;
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests {
    /// A property that is written but not listed would never run.
    #[test]
    fn every_property_is_listed() {
        let sources = [
            include_str!("matter.rs"),
            include_str!("views.rs"),
            include_str!("mirror.rs"),
            include_str!("sampling.rs"),
            include_str!("levels.rs"),
            include_str!("seams.rs"),
            include_str!("compositing.rs"),
            include_str!("order.rs"),
            include_str!("requests.rs"),
            include_str!("planes.rs"),
            include_str!("cubes.rs"),
            include_str!("sheets.rs"),
            include_str!("surfaces.rs"),
            include_str!("parts.rs"),
            include_str!("outlines.rs"),
            include_str!("windows.rs"),
        ];
        let written = sources.iter().flat_map(|text| text.lines());
        let written: Vec<_> = written.filter(|line| line.starts_with("pub fn ")).collect();
        assert_eq!(written.len(), super::ALL.len(), "{written:#?}");
    }
}
